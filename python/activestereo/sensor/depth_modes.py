# SPDX-License-Identifier: Apache-2.0
"""Eight models of a depth camera, from the exact depth to full simulation, for comparing policies trained on each.

| mode | depth |
|--|--|
| clean | exact depth of the first surface, as a z-buffer has it |
| gaussian | exact depth with noise that grows with the square of the depth |
| datasheet | as gaussian, with the noise of a datasheet's subpixel RMS |
| simkinect | exact depth, shifted and in steps of disparity (Barron and Malik 2013; Handa et al. 2014) |
| redwood | as simkinect, coarser, as Habitat and Open3D have it (Choi et al. 2015) |
| isaac-like | noise, steps, occlusion and missing texture, as Isaac Sim's single-view depth sensor |
| raster | matched stereo of Lambertian surfaces without bounces of light (Planche et al., DepthSynth, 3DV 2017) |
| full | matched stereo of path-traced images |
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates, uniform_filter

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import PoseLike
from activestereo.common.shown import unknown
from activestereo.sensor.batch import StereoDepthSensorBatch
from activestereo.sensor.gbuffer.cause import in_front, inverse_depth, mean_and_deviation, warped
from activestereo.sensor.mounts import HasPoses

Depth = NDArray[np.float32]
# simkinect (github.com/ankurhanda/simkinect, add_noise.py, commit 1106ad0b). Each pixel's value comes from a neighbour.
# A 9 x 9 window accepts it if 1 / 1.2 of its neighbours lie within 0.1 px of the window's mean; each difference is
# first divided by 1.44 times the squared pixel distance. Accepted values spread up to 3 px. Then come steps of 1/8 px
# with noise of 1/6 step (35130 px cm is 8 times a Kinect's focal length times baseline), rounded half a step too near:
# round(x + 0.5). Its picture of a Kinect's dots is data and is left out: here each pixel is a dot.
_KINECT_STEPS = 8.0
_KINECT_SHIFT_PX, _KINECT_SIGMA_STEPS, _KINECT_BIAS_STEPS = 0.5, 1.0 / 6.0, 0.5
_KINECT_WINDOW, _KINECT_INLIER_PX, _KINECT_PER_SQUARE_PX, _KINECT_LEAST_SHARE = 9, 0.1, 1.2**2, 1.0 / 1.2
_KINECT_FILL_PX = 3.0
# Redwood (redwood-data.org/indoor/data/simdepth.py), by Habitat (habitat-sim, redwood_depth_noise_model.py, commit
# 0586bec6, which has the farthest depth) and Open3D (t::io::DepthNoiseSimulator): 35.130 px m of its PrimSense is here
# the sensor's own focal length times baseline; the lens table, measured on one device, is left out.
_REDWOOD_SHIFT_PX, _REDWOOD_SIGMA_PX, _REDWOOD_FARTHEST_M, _REDWOOD_STEPS = 0.25, 0.027778, 10.0, 8.0
# Intel, "Best-known methods for tuning RealSense D400": RMS of subpixels of a passive, well textured plane.
_DATASHEET_SUBPIXEL = 0.08
# Standard deviation of a texture within the window, of 255 grey levels.
_TEXTURE_WINDOW, _TEXTURE_LEVELS = 7, 4.0


def gaussian(depth: Depth, sigma_m_at_1_m: float, random: np.random.Generator) -> Depth:
    """Returns depth with Gaussian noise whose standard deviation grows with the square of the depth. sigma_m_at_1_m:
    its value at 1 m."""
    noise = random.standard_normal(depth.shape, np.float32)
    return np.where(depth > 0, depth + np.float32(sigma_m_at_1_m) * depth**2 * noise, 0.0).astype(np.float32)


def simkinect(depth: Depth, focal_baseline_px_m: float, random: np.random.Generator) -> Depth:
    """Returns depth with simkinect's noise (Handa et al. 2014; Barron and Malik 2013): shifted pixels, and disparity in
    jittered steps. A pixel that disagrees with its window (Bohg et al. 2014) takes the disparity of the nearest
    accepted pixel within 3 px, else depth 0."""
    row, column = _places(depth.shape, _KINECT_SHIFT_PX, random)
    stack = [map_coordinates(image, at, order=1, mode="nearest") for image, *at in zip(depth, row, column, strict=True)]
    with np.errstate(divide="ignore"):
        disparity = np.rint(focal_baseline_px_m / np.stack(stack) * _KINECT_STEPS) / _KINECT_STEPS
    is_accepted = _agreeing(disparity)
    for image, is_own in zip(disparity, is_accepted, strict=True):
        if is_own.any():
            distance_px, (rows, columns) = distance_transform_edt(~is_own, return_indices=True)
            image[:] = np.where(distance_px <= _KINECT_FILL_PX, image[rows, columns], 0.0)
        else:
            image[:] = 0.0
    accepted = np.divide(focal_baseline_px_m, disparity, out=np.zeros(depth.shape), where=disparity > 0.0)
    jitter = _KINECT_SIGMA_STEPS * random.standard_normal(depth.shape) + _KINECT_BIAS_STEPS
    return _rounded(accepted.astype(np.float32), focal_baseline_px_m, jitter / _KINECT_STEPS, 1.0 / _KINECT_STEPS)


def redwood(
    depth: Depth, focal_baseline_px_m: float, random: np.random.Generator, farthest_m: float = _REDWOOD_FARTHEST_M
) -> Depth:
    """Returns depth with Redwood's noise (Choi et al. 2015): each pixel takes the depth of a random neighbour on an
    even row and column; its disparity is jittered and rounded. Depth of farthest_m or more becomes 0."""
    row, column = (np.rint(at).astype(np.intp) // 2 * 2 for at in _places(depth.shape, _REDWOOD_SHIFT_PX, random))
    coarse = depth[np.arange(len(depth))[:, None, None], row, column]
    jitter = _REDWOOD_SIGMA_PX * random.standard_normal(depth.shape)
    near = np.where(coarse < farthest_m, coarse, np.float32(0.0))
    return _rounded(near, focal_baseline_px_m, jitter, 1.0 / _REDWOOD_STEPS)


# Names of the models that need only the true depth of one view.
OF_TRUTH = ("clean", "gaussian", "datasheet", "simkinect", "redwood", "isaac-like")
# Standard deviation of 'gaussian' at 1 m. A D435's subpixel noise of 0.08 px gives this.
_SIGMA_M_AT_1_M = 0.004


def one_view_depth(
    model: str, depth: Depth, gray: NDArray[np.float32] | None, focal_px: float, focal_baseline_px_m: float,
    random: np.random.Generator, settings: IsaacSettings | None = None,
) -> Depth:  # fmt: skip
    """Returns the depth that a model of OF_TRUTH measures. depth: true depth, metres [E, height, width]. gray,
    settings: as for isaac(); only 'isaac-like' uses them."""
    if model == "clean":
        return depth
    if model == "gaussian":
        return gaussian(depth, _SIGMA_M_AT_1_M, random)
    if model == "isaac-like":
        return isaac(depth, gray, focal_px, focal_baseline_px_m / focal_px, settings or IsaacSettings(), random)
    if model == "datasheet":  # sigma(z) = z^2 * subpixel / (f B), as the makers of stereo cameras state it
        return gaussian(depth, _DATASHEET_SUBPIXEL / focal_baseline_px_m, random)
    if model == "redwood":
        return redwood(depth, focal_baseline_px_m, random)
    return simkinect(depth, focal_baseline_px_m, random)


@dataclass(frozen=True)
class IsaacSettings:
    """Settings of isaac(). The defaults are those of Isaac Sim's single-view depth sensor (ovrtx 0.7.0,
    sensors/visual/depth_camera; numbers from a user's note on Isaac Sim 6.0.1). step_px is its noiseMean.
    needs_texture: drop pixels of low local contrast, as its confidence of 0.70 drops an untextured wall at 1 m; its
    formula is not published."""

    step_px: float = 0.25
    sigma_px: float = 0.25
    max_disparity_px: float = 110.0
    min_distance_m: float = 0.5
    needs_texture: bool = True


def isaac(
    depth: Depth, gray: NDArray[np.float32] | None, focal_px: float, baseline_m: float, settings: IsaacSettings,
    random: np.random.Generator,
) -> Depth:  # fmt: skip
    """Returns depth with the noise of Isaac Sim's single-view depth sensor. Depth is 0 outside the settings' limits and
    where the virtual second view does not see the surface. gray: the picture, 0..1, for settings.needs_texture."""
    inverse = inverse_depth(depth)
    disparity = focal_px * baseline_m * inverse
    beside = warped(inverse, focal_px, baseline_m).inverse_depth
    x = np.arange(depth.shape[-1]) - disparity
    nearer_px = focal_px * baseline_m * in_front(beside, x, inverse)
    is_kept = (depth >= settings.min_distance_m) & (x >= 0.0) & (nearer_px < 1.0)
    if settings.needs_texture:
        if gray is None:
            raise ValueError("IsaacSettings.needs_texture: the picture is missing: give `gray`, or set it to False")
        _, contrast = mean_and_deviation(gray, (1, _TEXTURE_WINDOW, _TEXTURE_WINDOW))
        is_kept &= contrast * 255.0 > _TEXTURE_LEVELS
    jitter = settings.sigma_px * random.standard_normal(depth.shape)
    is_kept &= disparity < settings.max_disparity_px
    return _rounded(np.where(is_kept, depth, np.float32(0.0)), focal_px * baseline_m, jitter, settings.step_px)


def _places(
    shape: tuple[int, ...], sigma_px: float, random: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (rows, columns), in pixels, of a random point near each pixel of images of this shape, [E, height,
    width]. sigma_px: standard deviation of its offset."""
    count, height, width = shape
    row, column = (random.normal(0.0, sigma_px, shape) for _ in range(2))
    row += np.arange(height)[:, None]
    column += np.arange(width)
    return np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)


def _agreeing(disparity: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Returns a mask of the disparities that simkinect keeps: at least five sixths of the window around them are near
    the window's mean. Infinite disparities and those in the image's outer three rows and columns are false."""
    is_known = np.isfinite(disparity)
    known = np.where(is_known, disparity, 0.0)
    window, reach = (1, _KINECT_WINDOW, _KINECT_WINDOW), _KINECT_WINDOW // 2
    count = uniform_filter(is_known.astype(np.float64), window, mode="constant")
    mean = uniform_filter(known, window, mode="constant") / np.maximum(count, 1e-9)
    agree = np.zeros(disparity.shape)
    padded, is_there = (np.pad(image, ((0, 0), (reach, reach), (reach, reach))) for image in (known, is_known))
    height, width = disparity.shape[1:]
    for v, u in np.ndindex(_KINECT_WINDOW, _KINECT_WINDOW):
        farther = max(_KINECT_PER_SQUARE_PX * ((v - reach) ** 2 + (u - reach) ** 2), 1.0)
        part = (slice(None), slice(v, v + height), slice(u, u + width))
        agree += is_there[part] & (np.abs(padded[part] - mean) < _KINECT_INLIER_PX * farther)
    return np.asarray(is_known & (agree > _KINECT_LEAST_SHARE * _KINECT_WINDOW**2))


def _rounded(depth: Depth, focal_baseline_px_m: float, jitter_px: NDArray[np.float64], step_px: float) -> Depth:
    """Converts depth to disparity, adds jitter_px, rounds to whole steps of step_px, and converts back.
    focal_baseline_px_m: focal length, px, times baseline, m."""
    with np.errstate(divide="ignore", invalid="ignore"):
        disparity = np.rint((focal_baseline_px_m / depth + jitter_px) / step_px) * step_px
        return np.where((depth > 0) & (disparity > 0), focal_baseline_px_m / disparity, 0.0).astype(np.float32)


MODES = (*OF_TRUTH, "raster", "full")


class DepthCamera:
    """Measures depth by one of MODES with the RGB camera of a sensor on each mount. 'raster' makes every material of
    the scene Lambertian, for good. pose: the RGB camera's pose relative to its mount; None: identity. isaac: settings
    of 'isaac-like'; None: Isaac Sim's, which drop depth below 0.5 m and surfaces without texture."""

    def __init__(
        self, mode: str, config: StereoDepthSensorConfig, mounts: HasPoses, pose: PoseLike | None = None,
        isaac: IsaacSettings | None = None,
    ) -> None:  # fmt: skip
        if mode not in MODES:
            raise ValueError(unknown("mode", mode, MODES))
        self.mode, self._isaac = mode, isaac or IsaacSettings()
        config = deepcopy(config)
        if mode == "raster":
            make_lambertian(mounts.scene)
            config.max_bounces = 0
        self.sensors = StereoDepthSensorBatch(config, mounts, pose)
        self._config = config
        self._random = np.random.default_rng(config.noise_seed)

    def seed(self, seed: int) -> None:
        """Restarts all noise under this seed; the same seed repeats it."""
        self._random = np.random.default_rng(seed)
        self.sensors.restart(seed)

    def take_depth(self) -> NDArray[np.float32]:
        """Measures the scene as it is now. Returns float32 [E, height, width], metres in the RGB camera, 0 = no
        measurement."""
        if self.mode in ("raster", "full"):
            self.sensors.take_picture(infrared_only=True)
            self.sensors.compute_depth()
            return self.sensors.get_depth()
        c, gray = self._config, None
        if self.mode == "isaac-like" and self._isaac.needs_texture:
            self.sensors.take_picture()
            truth, gray = self.sensors.get_true_depth(), self.sensors.get_rgb().mean(axis=-1)
        else:
            truth = self.sensors.render_true_depth()
        truth = np.where((truth >= c.min_depth_m) & (truth < c.max_depth_m), truth, np.float32(0.0))
        lens = float(c.ir_intrinsic[0, 0]), c.focal_baseline_px_m
        return one_view_depth(self.mode, truth, gray, *lens, self._random, self._isaac)


def make_lambertian(scene: kuafu.Scene) -> None:
    """Removes gloss, metal, glass and subsurface scattering from every material; diffuse colours stay."""
    for number in range(scene.summary.material_count):
        material = scene.get_material(number)
        material.metallic = material.specular = material.transmission = material.subsurface = 0.0
        material.ir_transmission = None
        scene.set_material(number, material)
