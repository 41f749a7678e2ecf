# SPDX-License-Identifier: Apache-2.0
"""A table-top that is ray-cast under one rig, for tests of effects against worlds with the effect in them."""

import numpy as np
from scipy.ndimage import binary_dilation, maximum_filter, minimum_filter

from activestereo.capture.capture import Camera, Frame, Projector, Rig
from activestereo.common.pose import rigid_motion
from activestereo.effects import Light, View
from virtual_sensor.view import PatternSource, look
from virtual_sensor.world import dot_pattern, look_at, table_top

SIZE = (106, 60)
POSE = look_at((0.1, 0.4, 0.5), (0.0, 0.08, -0.2))
TWIST = np.array([0.5, -0.2, 0.1, 0.2, 0.5, -0.3])
PATTERN = dot_pattern(320, 200, 900, 1) / 255.0
CAMERA_K = np.array([[53.0, 0, 52.5], [0, 53.0, 29.5], [0, 0, 1.0]])
PROJECTOR_K = np.array([[148.0, 0, 159.5], [0, 148.0, 99.5], [0, 0, 1.0]])


def shift(x):
    return rigid_motion((x, 0, 0))


RIG = Rig(Camera(*SIZE, CAMERA_K), Camera(*SIZE, CAMERA_K), shift(-0.05), Projector(None, PROJECTOR_K, shift(-0.015)))


def seen(side="right", left_to_world=POSE, baseline_m=0.05, projector_K=PROJECTOR_K, pattern=PATTERN, bounces=1):
    """The truth: a Light, and (depth, normal). Same seed everywhere, so that differences are the effect's."""
    camera = left_to_world @ (shift(baseline_m) if side == "right" else np.eye(4))
    source_pose = left_to_world @ shift(0.015)

    source = PatternSource(source_pose[:3, 3], source_pose[:3, :3], projector_K, pattern)
    view = look(table_top(), SIZE, CAMERA_K, camera, source, seed=3, grid=6, bounces=bounces)
    return Light(view.direct, view.indirect, view.sky, view.flat), (view.depth, view.normal @ camera[:3, :3])


def view_of(geometry, side="right"):
    frame = Frame(0, None, None, 0.0, 0.004, POSE, "train", camera_velocity=TWIST, temperature_c=45.0)
    left_to_camera = RIG.left_to_right if side == "right" else np.eye(4)
    to_projector = shift(-0.015) @ np.linalg.inv(left_to_camera)
    return View(side, CAMERA_K, *geometry, PATTERN, PROJECTOR_K, to_projector, left_to_camera, frame)


def smooth_places(depth):
    """Away from the picture's border and from depth steps, where new surfaces come into sight."""
    step = maximum_filter(depth, 3) - minimum_filter(depth, 3)
    rough = binary_dilation((step > 0.06) | (depth == 0), iterations=2)
    inside = np.zeros(depth.shape, bool)
    inside[2:-2, 2:-2] = True
    return inside & ~rough
