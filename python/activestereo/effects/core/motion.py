# SPDX-License-Identifier: Apache-2.0
"""Computes images of a camera at another pose. A turn about its centre moves pixels whatever their depth; a shift moves
each pixel by its depth. A rig before or after mid-exposure sees the scene shifted, and its own dots hardly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from activestereo.common.pose import motion_of_twist
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import sample
from activestereo.effects.core.view import View, transform

_ITERATIONS = 3


def posed(light: Light, view: View, to_nominal: np.ndarray) -> Light:
    """Returns the Light of a camera at another pose. to_nominal: that camera's coordinates to those of the view's
    camera, [4][4]. New occlusions are not seen, since poses differ by a few pixels."""
    turn, shift = to_nominal[:3, :3], to_nominal[:3, 3]
    if shift.any():
        return light.warped(*_source_pixels(view, np.broadcast_to(to_nominal, (view.shape[0], 4, 4)))[:2])
    if (turn == np.eye(3)).all():
        return light
    rx, ry = view.rays()
    ray = np.stack([rx, ry, np.ones_like(rx)], axis=-1) @ turn.T
    return light.warped(*view.to_pixels(ray[..., 0] / ray[..., 2], ray[..., 1] / ray[..., 2]))


def displaced(light: Light, view: View, dt_s: float | np.ndarray) -> Light:
    """Returns the Light at time mid-exposure + dt_s: a number, or one per row [height] for row-wise readout.

    Each pixel finds where its surface point is at mid-exposure, and takes the scene's light from there. The dots stay
    with the rig: the pixel's new depth places them, and the new distance and angle to the projector scale them. New
    occlusions and shadows are not seen, since motions are of a few pixels.
    """
    rows = np.broadcast_to(np.asarray(dt_s, dtype=np.float64), view.shape[:1])
    if not view.frame.is_moving or not rows.any():
        return light
    then_to_mid = _poses(view, rows)
    u, v, then, mid = _source_pixels(view, then_to_mid)
    moved = light.warped(u, v)
    flat = moved.flat * _falloff_ratio(view, then_to_mid, u, v, then, mid)
    dots = DotView.of(view)
    nominal = dots.nominal()
    now = dots.mean(view.pattern, *dots.project(transform(view.camera_to_projector, then)))
    lit = dots.lit & (light.flat > 0)
    seen = np.where(lit, light.direct / np.where(lit, light.flat, 1.0), nominal)
    direct = np.maximum(flat * (seen + now - nominal), 0.0)
    return replace(moved, direct=direct, flat=flat)


def _poses(view: View, rows: np.ndarray) -> np.ndarray:
    """Returns the rig's motion as one pose per row, [height][4][4], from camera coordinates at the row's time to those
    at mid-exposure. rows: each row's time after mid-exposure, seconds, [height]."""
    twist, to_left = view.frame.camera_velocity, np.linalg.inv(view.left_to_camera)
    times, index = np.unique(rows, return_inverse=True)
    poses = np.stack([view.left_to_camera @ motion_of_twist(t * twist) @ to_left for t in times])
    return poses[index]


def _source_pixels(view: View, then_to_mid: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Returns each pixel's position (u, v) of its surface point at mid-exposure. Then come the point's camera
    coordinates [height][width][3] at the row's time and at mid-exposure. then_to_mid: [height][4][4], see _poses()."""
    rotation, shift = then_to_mid[:, :3, :3], then_to_mid[:, None, :3, 3]
    far = view.depth_m.max() if view.depth_m.any() else 1.0
    depth_mid = np.where(view.depth_m > 0, view.depth_m, 100.0 * far)  # at such a depth only turns show
    depth = depth_mid
    for _ in range(_ITERATIONS):
        then = view.points(depth)
        mid = then @ np.swapaxes(rotation, -1, -2) + shift
        u, v = view.to_pixels(mid[..., 0] / mid[..., 2], mid[..., 1] / mid[..., 2])
        depth_there = sample(depth_mid, u, v, order=1)
        depth = depth * depth_there / mid[..., 2]
    return u, v, then, mid


def _falloff_ratio(
    view: View, then_to_mid: np.ndarray, u: np.ndarray, v: np.ndarray, then: np.ndarray, mid: np.ndarray
) -> np.ndarray:
    """Returns [height][width]: the projector's irradiance on each surface point at the row's time, over that at
    mid-exposure. u, v, then, mid: from _source_pixels(). Only the rig moves."""
    source = np.linalg.inv(view.camera_to_projector)[:3, 3]
    normal_mid = np.moveaxis(sample(np.moveaxis(view.normal, -1, 0), u, v, order=1), 0, -1)
    normal_then = normal_mid @ then_to_mid[:, :3, :3]

    def irradiance(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
        way = source - points
        return np.maximum((normal * way).sum(-1), 0.0) / np.linalg.norm(way, axis=-1) ** 3

    before = irradiance(mid, normal_mid)
    safe = before > 0
    return np.where(safe, np.clip(irradiance(then, normal_then) / np.where(safe, before, 1.0), 0.0, 4.0), 1.0)
