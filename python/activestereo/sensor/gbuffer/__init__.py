# SPDX-License-Identifier: Apache-2.0
"""The depth sensor on another renderer's images: depth, normals, albedo and materials of the left infrared camera go in
(buffers.py), the other views are warped from it (warp.py), lit by the projector (light.py), counted and matched
(stereo.py), and each hole is named (cause.py).
"""
