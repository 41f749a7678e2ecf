# SPDX-License-Identifier: Apache-2.0
"""A local page that shows captures, scenes and recordings, and renders them again as its sliders move: `activestereo
view`.

| file | job |
|--|--|
| server.py | HTTP on the loopback address, and which requests are answered |
| routes.py | the page's calls, answers and saved models |
| library.py | a folder's entries, and pairs of pictures as captures |
| sources.py | a capture: its frames, and the sensor that took them, with light and noise fitted; a scene file |
| settings.py | the sliders, and their settings |
| simulation.py | one exposure under these settings |
"""
