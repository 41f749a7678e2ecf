# SPDX-License-Identifier: Apache-2.0
"""The depth sensor on another renderer's images.

The left infrared camera's depth, normals, albedo and materials go in (buffers.py). The other views are warped from it
(warp.py) and lit by the projector (light.py). The imager counts and the engine matches (stereo.py); each hole gets a
cause (cause.py).
"""
