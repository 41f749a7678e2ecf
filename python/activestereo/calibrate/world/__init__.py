# SPDX-License-Identifier: Apache-2.0
"""A real camera and a room, measured from views with depth: no wall, no rig, no repeats.

views     what was recorded, and whether it can be used     calibrate/world/views.py
camera    focal length, centre, baseline, the pair's rows   calibrate/world/camera.py
poses     where each view was taken from                    calibrate/world/poses.py
pattern   the projector's place and dots                    calibrate/world/pattern.py
light     albedo, room light, exposures, the lens's falloff calibrate/world/light.py
mesh      all of it as a scene                              calibrate/world/mesh.py
world     the steps one after the other                     calibrate/world/world.py
"""
