# SPDX-License-Identifier: Apache-2.0
"""A local page that shows captures, scenes and recordings, and renders them again as its sliders move: `activestereo
view`.

| file | job |
|--|--|
| guard.py | which requests are answered |
| server.py | HTTP on the loopback address |
| routes.py | the page's calls |
| packing.py | images and numbers as one answer |
| library.py | a folder's entries |
| capture_source.py | a capture: its frames, and the sensor that took them |
| pictures.py | pairs of a recording or a data set as a capture without a scene |
| scene_source.py | a scene file: its cameras, and a preset's sensor |
| fit.py | projector's light, room's light and black level of a capture, and its noise |
| settings.py | the sliders' settings |
| sliders.py | the sliders' ends |
| save.py | the sensor under these settings as model.json |
| simulation.py | one exposure under these settings |
"""
