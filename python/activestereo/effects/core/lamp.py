# SPDX-License-Identifier: Apache-2.0
"""Computes how an added light (a lamp in the world, the sun, another projector) lights the pixels of a camera. Proposes
starting values for a lamp's fit."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.ndimage import gaussian_filter, zoom

import kuafu
from activestereo.common.pose import rigid_motion
from activestereo.effects.core.descriptor import StartImage
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.engine import angles, axes, towards
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import disc_sampler
from activestereo.effects.core.room_unit import SeenPoints
from activestereo.effects.core.shading import Facing, reflectance_of
from activestereo.effects.core.view import View, transform

# Shadow rays start at every second pixel and end after _REACH_M. A surface more than _THICK_M before a ray casts
# no shadow: the ray may pass behind it.
_EVERY_PX, _STEPS, _REACH_M, _FIRST_STEP_M = 2, 24, 0.8, 0.006
_THICK_M = 0.3
# A ray is in a surface's shadow where it runs at least this share of the depth behind the surface.
_BEHIND_SHARE = 0.006
# A Gaussian softens the shadows' edges; in pixels of the coarse shadow image.
_SOFT_PX = 0.7
# The grid of a lamp's possible positions, and the number of pixels to which each is fitted.
_AZIMUTHS_RAD = tuple((np.arange(-8, 8) * np.pi / 8).tolist())
_ELEVATIONS_RAD, _NEARNESSES_PER_M, _PIXELS = (0.2, 0.6, 1.0, 1.3), (0.3, 0.6, 1.0, 1.5), 20000
# Normals are rendered in float32: singular values below this share of the largest are rounding.
_ROUNDING = 1e-6


def lamp_pose(azimuth_rad: float, elevation_rad: float, nearness_per_m: float) -> np.ndarray:
    """Returns the pose [4][4] of a light in a direction from the world's origin; its +z axis points back to the origin.
    nearness_per_m: 1 / distance; 0 = infinitely far, and the pose stands at the origin."""
    place = towards(azimuth_rad, elevation_rad) / nearness_per_m if nearness_per_m > 0 else np.zeros(3)
    return rigid_motion(place, axes(azimuth_rad, elevation_rad, 0.0) * (-1.0, 1.0, -1.0))


def radiance_under(added: kuafu.Light, to_camera: np.ndarray, light: Light, view: View) -> np.ndarray:
    """Returns the radiance [height][width] that an added light gives the diffuse surfaces. Point and directional lights
    cast shadows; a projector of the rig's pattern does not. to_camera: the light's pose [4][4] in camera
    coordinates."""
    facing, reflectance = Facing.of(view), reflectance_of(light, view)
    if added.kind == "directional":
        way = -to_camera[:3, 2]
        irradiance = facing.cosine(way)
    else:
        way, _, irradiance = facing.from_source(to_camera[:3, 3])
    assert added.ir_intensity is not None  # the effect has set it
    if added.kind == "projector":
        return added.ir_intensity * _dots(facing, to_camera, view) * irradiance * reflectance
    lit = view.latest("lamp's shadow", None, lambda: _lit(view, way), choice=to_camera.tobytes())
    return added.ir_intensity * reflectance * irradiance * lit


def _dots(facing: Facing, to_camera: np.ndarray, view: View) -> np.ndarray:
    """Returns the rig's pattern as another projector casts it on each pixel's surface point, [height][width]."""
    own, points = DotView.of(view), transform(np.linalg.inv(to_camera), facing.points)
    # The pattern's mean over a camera pixel, a box by the ratio of the focal lengths.
    box = (np.full(view.shape, view.projector_K[i, i] / view.K[i, i]) for i in (0, 1))
    dots = disc_sampler(own.pattern, 0.0)(*own.project(points), *box)
    return np.where((points[..., 2] > 0) & facing.hit, dots, 0.0)


def _lit(view: View, way: np.ndarray) -> np.ndarray:
    """Returns the share 0..1 of a lamp's light that each pixel's surface point receives, [height][width]. way:
    directions from the points to the lamp. Only surfaces in the depth image cast shadows."""
    depth = view.depth_m[::_EVERY_PX, ::_EVERY_PX].astype(np.float32)
    points = view.points()[::_EVERY_PX, ::_EVERY_PX].astype(np.float32)
    way = np.broadcast_to(way, view.points().shape)[::_EVERY_PX, ::_EVERY_PX].astype(np.float32)
    height, width = depth.shape
    K = (np.diag([1.0 / _EVERY_PX, 1.0 / _EVERY_PX, 1.0]) @ view.K).astype(np.float32)
    # Pixel coordinates times depth are linear along a ray.
    (column_z, row_z, z), (column_step, row_step, z_step) = (np.moveaxis(x @ K.T, -1, 0) for x in (points, way))
    shadowed = np.zeros(depth.shape, dtype=bool)
    for step in np.geomspace(_FIRST_STEP_M, _REACH_M, _STEPS).astype(np.float32):
        along = z + step * z_step
        at = np.maximum(along, np.float32(1e-3))
        column = np.rint((column_z + step * column_step) / at).astype(np.int32)
        row = np.rint((row_z + step * row_step) / at).astype(np.int32)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height) & (along > 0.05)
        there = depth.take(np.where(inside, row * width + column, 0))
        behind = at - there
        shadowed |= inside & (there > 0) & (behind > _BEHIND_SHARE * at + 0.25 * step) & (behind < _THICK_M)
    soft = gaussian_filter((~shadowed).astype(np.float32), _SOFT_PX, mode="mirror")
    factors = [full / part for full, part in zip(view.shape, soft.shape, strict=True)]
    return zoom(soft, factors, np.float64, order=1, mode="nearest", grid_mode=True)


def lamp_starts(images: list[StartImage]) -> list[dict[str, float]]:
    """Returns starting values for a fit: a light infinitely far, a lamp at 2 m in its direction, and the best lamp of a
    grid."""
    if not images:
        return []
    seen = SeenPoints.of(images, _PIXELS)
    return _far_starts(seen) + _near_starts(seen)


def _far_starts(seen: SeenPoints) -> list[dict[str, float]]:
    """Returns starting values for a light infinitely far. On lit surfaces the residual over reflectance is linear in
    the normal, so that a regression gives direction and strength.

    Surfaces that face away show no light; each of four rounds leaves them out (photometric stereo: Woodham 1980).
    """
    vector = np.zeros(3)
    for _ in range(4):
        lit = seen.normals @ vector > 0 if vector.any() else np.ones(len(seen.normals), dtype=bool)
        some = SeenPoints(*(x[lit] for x in seen))
        vector = _regression(some, np.pi * some.glow * some.normals.T)[0][:3]
    strength = float(np.linalg.norm(vector))
    if strength == 0.0:
        return []
    azimuth, elevation = angles(vector)
    start = {"strength": strength, "azimuth_rad": azimuth, "elevation_rad": elevation}
    return [start, start | {"nearness_per_m": 0.5}]


def _near_starts(seen: SeenPoints) -> list[dict[str, float]]:
    """Fits a near lamp at each place of a grid and returns the one that explains most of the residual beside ambient
    light. Shadows are ignored. A near lamp's light falls with distance, so the fit uses the points' positions and
    normals."""
    ways = list(product(_AZIMUTHS_RAD, _ELEVATIONS_RAD))
    directions = np.stack([towards(*way) for way in ways])
    best: list[dict[str, float]] = []
    most = 0.0
    for nearness in _NEARNESSES_PER_M:
        lit = np.pi / nearness**2 * seen.lit_from(directions / nearness)[1]
        for (azimuth, elevation), column in zip(ways, lit, strict=True):
            (strength, _), gain = _regression(seen, column[None])
            if strength > 0.0 and gain > most:
                place = {"azimuth_rad": azimuth, "elevation_rad": elevation, "nearness_per_m": nearness}
                best, most = [{"strength": float(strength)} | place], gain
    return best


def _regression(seen: SeenPoints, columns: np.ndarray) -> tuple[np.ndarray, float]:
    """Fits columns [k][n] and the ambient light to the residual of n points. Returns the k + 1 factors and the decrease
    of chi squared."""
    columns = np.stack([*columns, seen.ambient])
    moment = columns @ (seen.weight * seen.residual)
    factors = np.linalg.lstsq((columns * seen.weight) @ columns.T, moment, rcond=_ROUNDING)[0]
    return factors, float(factors @ moment)
