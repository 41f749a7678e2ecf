# SPDX-License-Identifier: Apache-2.0
"""Simulates the depth sensor on another renderer's images (G-buffers).

The input images show depth, normals, albedo and materials of the left infrared camera's view. kuafu warps them to the
views of the right camera and the projector, and lights them. Then imager and matcher follow (stereo.py). Each pixel
without depth gets a cause (cause.py).
"""
