# SPDX-License-Identifier: Apache-2.0
"""Images of a camera at another pose: turned about its centre, where every pixel sees what another saw, whatever the
depth; moved, where each pixel looks up by its own depth; and with its rig before or after mid-exposure, where the scene
shifts and the rig's own dots hardly do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from activestereo.effects.core.dots import DotView
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import sample
from activestereo.effects.core.view import View

_ITERATIONS = 3


def posed(light: Light, view: View, to_nominal: np.ndarray) -> Light:
    """The Light of a camera at another pose; to_nominal: its coordinates to those of the view's camera, [4][4]. New
    occlusions are not seen: moves are of a few pixels."""
    turn, shift = to_nominal[:3, :3], to_nominal[:3, 3]
    if shift.any():
        return light.warped(*_source_pixels(view, np.broadcast_to(to_nominal, (view.shape[0], 4, 4)))[:2])
    if (turn == np.eye(3)).all():
        return light
    rx, ry = view.rays()
    ray = np.stack([rx, ry, np.ones_like(rx)], axis=-1) @ turn.T
    return light.warped(*view.to_pixels(ray[..., 0] / ray[..., 2], ray[..., 1] / ray[..., 2]))


def displaced(light: Light, view: View, dt_s: float | np.ndarray) -> Light:
    """The Light at time mid-exposure + dt_s: a number, or one per row [height] (row-wise readout).

    Each pixel looks up where the point that it sees then is at mid-exposure. Scene light is taken from there; the dots
    stay with the rig, are placed by the pixel's own new depth, and their strength follows the new distance and angle to
    the projector. New occlusions and shadows are not seen: the motions meant here are of few pixels.
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
    now = dots.mean(view.pattern, *dots.project_camera(then))
    lit = dots.lit & (light.flat > 0)
    seen = np.where(lit, light.direct / np.where(lit, light.flat, 1.0), nominal)
    direct = np.maximum(flat * (seen + now - nominal), 0.0)
    return replace(moved, direct=direct, flat=flat)


def _poses(view: View, rows: np.ndarray) -> np.ndarray:
    """[height][4][4]: camera coordinates at each row's time to those at mid-exposure."""
    twist = view.frame.camera_velocity
    velocity, spin = twist[:3], twist[3:]
    generator = np.zeros((4, 4))
    generator[:3, :3] = [[0, -spin[2], spin[1]], [spin[2], 0, -spin[0]], [-spin[1], spin[0], 0]]
    generator[:3, 3] = velocity
    to_left = np.linalg.inv(view.left_to_camera)
    times, index = np.unique(rows, return_inverse=True)
    poses = np.stack([view.left_to_camera @ expm(t * generator) @ to_left for t in times])
    return poses[index]


def _source_pixels(view: View, then_to_mid: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(u, v) at mid-exposure of what each pixel sees then, and its camera coordinates then and at mid-exposure."""
    rotation, shift = then_to_mid[:, :3, :3], then_to_mid[:, None, :3, 3]
    far = view.depth_m.max() if view.depth_m.any() else 1.0
    depth_mid = np.where(view.depth_m > 0, view.depth_m, 100.0 * far)  # the sky only turns
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
    """Projector irradiance then over that at mid-exposure, of one surface point: the rig moves, the surface does not.
    """
    source = np.linalg.inv(view.camera_to_projector)[:3, 3]
    normal_mid = np.moveaxis(sample(np.moveaxis(view.normal, -1, 0), u, v, order=1), 0, -1)
    normal_then = normal_mid @ then_to_mid[:, :3, :3]

    def irradiance(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
        way = source - points
        return np.maximum((normal * way).sum(-1), 0.0) / np.linalg.norm(way, axis=-1) ** 3

    before = irradiance(mid, normal_mid)
    safe = before > 0
    return np.where(safe, np.clip(irradiance(then, normal_then) / np.where(safe, before, 1.0), 0.0, 4.0), 1.0)
