# SPDX-License-Identifier: Apache-2.0
"""Simulates the depth sensor on another renderer's images (G-buffers).

Inputs are depth, normals, albedo and materials that the left infrared camera sees (inputs.py). The right camera's and
the projector's views are warped from them (warp.py). kuafu lights them; imager and matcher follow (stereo.py). Each
pixel without depth gets a cause (cause.py).
"""
