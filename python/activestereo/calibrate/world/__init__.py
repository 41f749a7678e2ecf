# SPDX-License-Identifier: Apache-2.0
"""Measures a real camera and a room from views with depth: without wall, board or repeats.

views     reads a recording and rejects unusable views    calibrate/world/views.py
pair      baseline, the right camera's principal point    calibrate/world/pair_geometry.py
poses     each view's pose, focal length, principal point calibrate/world/poses.py
pattern   the projector's position and dots               calibrate/world/pattern.py
light     albedo, room light, exposures, lens falloff     calibrate/world/light.py
mesh      the measured surfaces: scene file and masks     calibrate/world/mesh.py
world     the steps one after the other                   calibrate/world/world.py
"""
