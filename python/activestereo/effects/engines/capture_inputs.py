# SPDX-License-Identifier: Apache-2.0
"""Makes the EngineInputs of a capture's frame from its calibration, pose and settings, before any effect."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.capture.capture import Capture, Frame
from activestereo.common.lens import lens_fields
from activestereo.common.pose import carried_twist
from activestereo.effects.core.engine import EngineCamera, EngineInputs
from activestereo.effects.core.moved import frame_signal

# The box of a medium extends beyond scene and rig by this margin.
_MARGIN_M = 0.05


def capture_inputs(
    capture: Capture, frame: Frame, scene: kuafu.Scene, pattern: NDArray[np.float32], seed: int = 0
) -> EngineInputs:
    """Returns the engines' inputs for a frame, with the projector at 1 W/sr and ambient radiance 1. Nuisances (DN per
    second and gain, found by a fit) scale the images later. A moving frame stands still until an effect opens its
    shutter."""
    rig = capture.rig
    summary = scene.summary
    return EngineInputs(
        left=_side(capture, frame, "left", np.eye(4)),
        right=_side(capture, frame, "right", rig.left_to_right),
        projector=_projector(capture, frame),
        pattern=pattern,
        frame=frame,
        new_light=kuafu.Light,
        new_medium=kuafu.Medium,
        scene_materials=scene.get_material,
        material_count=summary.material_count,
        bounds_m=_bounds(capture, summary),
        max_dn=float(rig.max_dn),
        seed=seed,
    )


def _side(capture: Capture, frame: Frame, name: str, left_to_side: NDArray[np.float64]) -> EngineCamera:
    camera = capture.rig.camera(name)
    linear, angular = carried_twist(left_to_side, frame.camera_velocity).reshape(2, 3)
    return EngineCamera(
        camera=kuafu.Camera(
            camera.width,
            camera.height,
            camera.K,
            frame.camera_to_world @ np.linalg.inv(left_to_side),
            **lens_fields(camera.distortion),
            linear_velocity=linear,
            angular_velocity=angular,
        ),
        optics=kuafu.Optics(),
        signal=frame_signal(frame),
        is_right=name == "right",
    )


def _projector(capture: Capture, frame: Frame) -> kuafu.Light:
    projector = capture.rig.projector
    linear, angular = carried_twist(projector.left_to_projector, frame.camera_velocity).reshape(2, 3)
    pose = frame.camera_to_world @ np.linalg.inv(projector.left_to_projector)
    return kuafu.Light(
        kind="projector",
        name="projector",
        k=projector.K,
        ir_intensity=1.0,
        light_to_world=pose,
        linear_velocity=linear,
        angular_velocity=angular,
    )


def _bounds(capture: Capture, summary: kuafu.SceneSummary) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Returns the lower and upper corner of a box around the scene and every pose of the rig, world, metres."""
    corners = [summary.bounds_min_m, summary.bounds_max_m] if summary.triangle_count else []
    points = np.array([*corners, *(f.camera_to_world[:3, 3] for f in capture.frames)])
    return tuple(points.min(axis=0) - _MARGIN_M), tuple(points.max(axis=0) + _MARGIN_M)
