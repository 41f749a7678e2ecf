# SPDX-License-Identifier: Apache-2.0
"""A local page that shows captures, scenes and recordings, and renders them again as its sliders move: `activestereo
view`.

| file | job |
|--|--|
| server.py | HTTP on the loopback address, and which requests are answered |
| routes.py | the page's calls, answers and saved models |
| library.py | a folder's entries, and pairs of pictures as captures |
| capture_source.py | a capture: its frames, and the sensor that took them, with light and noise fitted |
| scene_source.py | a scene file: its cameras, and a preset's sensor |
| settings.py | the sliders' settings |
| sliders.py | the sliders' ends |
| simulation.py | one exposure under these settings |
"""
