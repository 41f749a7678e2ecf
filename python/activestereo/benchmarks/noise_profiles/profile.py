# SPDX-License-Identifier: Apache-2.0
"""Takes a sensor's views of random rooms, fits noise models to them, and measures the distance between the errors of
two kinds of depth."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import CAMERA_TO_BODY, Pose, look_at
from activestereo.common.progress_bar import Progress
from activestereo.model import SensorModel
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import add_mesh
from activestereo.sensor.sensor import StereoDepthSensor

_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Views:
    """Views of rooms in one sensor's left camera. truth_m, found_m: true and measured depth, float32 [rooms, height,
    width] metres, 0 = no surface, or not measured. gray: float32 of the same shape, 0..1, the surfaces' reflectance.
    near_m, far_m: the sensor's range of depth."""

    truth_m: NDArray[np.float32]
    found_m: NDArray[np.float32]
    gray: NDArray[np.float32]
    k: NDArray[np.float64]
    baseline_m: float
    near_m: float
    far_m: float

    @property
    def focal_baseline_px_m(self) -> float:
        return float(self.k[0, 0]) * self.baseline_m


def take_views(
    config: StereoDepthSensorConfig, model: SensorModel | None, count: int, seed: int, device: str | int = "auto",
    progress: Progress | None = None,
) -> Views:  # fmt: skip
    """Simulates the sensor in `count` rooms and returns their Views. model: its effects act, except those on named
    surfaces, which these rooms lack."""
    config = config.seen_from_left()
    config.rgb_distortion = (0.0,) * 5  # depth is registered to a pinhole
    if config.ir_exposure_mode == "converging":
        config.ir_exposure_mode = "settled"
    if model is not None:
        model = replace(model, effects=tuple(e for e in model.effects if not e.surfaces), materials={}, poses=())
    taken: list[tuple[NDArray[np.float32], ...]] = []
    for number in range(count):
        random = np.random.default_rng([seed, number])
        scene = kuafu.Scene(kuafu.Device(device))
        camera_to_world = _furnish(scene, random)
        config.render_seed = config.noise_seed = int(random.integers(2**31))
        with StereoDepthSensor(config, scene, pose=Pose(camera_to_world @ CAMERA_TO_BODY.T), model=model) as sensor:
            sensor.take_picture(infrared_only=True)
            sensor.compute_depth()
            seen = sensor.get_pictures(["depth", "albedo"])
            taken.append((seen["depth"][..., 0].copy(), sensor.get_depth().copy(), seen["albedo"].mean(axis=-1)))
        if progress is not None:
            progress((number + 1) / count)
    truth, found, gray = (np.stack(images).astype(np.float32) for images in zip(*taken, strict=True))
    baseline_m = config.focal_baseline_px_m / float(config.ir_intrinsic[0, 0])
    k = np.array(config.rgb_intrinsic, np.float64)
    return Views(truth, found, gray, k, baseline_m, config.min_depth_m, config.max_depth_m)


def _furnish(scene: kuafu.Scene, random: np.random.Generator) -> NDArray[np.float64]:
    """Fills the scene with a floor, two walls, objects, a lamp and light from all sides; returns camera_to_world."""
    far_m = random.uniform(1.5, 3.5)
    meshes = [add_mesh(scene, mesh) for mesh in (solids.box(), solids.sphere(), solids.cylinder())]

    def add_thing(mesh: int, half: NDArray[np.float64], at: NDArray[np.float64], turn: float, is_plain: bool) -> None:
        local_to_world = np.eye(4)
        local_to_world[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        local_to_world[:3, :3] *= half
        local_to_world[:3, 3] = at
        # A twentieth of the things are black, a tenth are metal.
        kind, albedo = random.uniform(), random.uniform(0.3, 0.8)
        if not is_plain and kind < 0.05:
            albedo = 0.04
        red, green, blue = (float(v) for v in albedo * random.uniform(0.7, 1.0, 3))
        material = kuafu.Material(base_color=(red, green, blue, 1.0), ir_albedo=albedo)
        material.roughness = random.uniform(0.6 if is_plain else 0.2, 1.0)
        material.metallic = 1.0 if not is_plain and 0.05 <= kind < 0.15 else 0.0
        scene.add_instance(meshes[mesh], [scene.add_material(material)], local_to_world=local_to_world)

    wall_m = random.uniform(1.0, 2.0)
    add_thing(0, np.array([4.0, 4.0, 0.02]), np.array([0.0, 0.0, -0.02]), 0.0, True)
    add_thing(0, np.array([0.02, 4.0, 3.0]), np.array([far_m, 0.0, 1.0]), random.uniform(-0.2, 0.2), True)
    add_thing(0, np.array([4.0, 0.02, 3.0]), np.array([0.0, wall_m, 1.0]), 0.0, True)
    for _ in range(int(random.integers(5, 11))):
        half = random.uniform(0.05, 0.25, 3)
        at = np.array([random.uniform(0.5, far_m - 0.3), random.uniform(-0.7, 0.8) * wall_m, half[2]])
        add_thing(int(random.integers(3)), half, at, random.uniform(0.0, np.pi), False)
    ambient = random.uniform(0.01, 0.3)
    scene.set_environment((ambient,) * 3)
    lamp_to_world = np.eye(4)
    lamp_to_world[:3, 3] = random.uniform([-0.5, -0.5, 1.5], [1.5, 0.5, 2.5])
    power = random.uniform(0.1, 1.5)
    scene.add_light(kuafu.Light(kind="point", intensity=(power,) * 3, light_to_world=lamp_to_world))
    eye = np.array([random.uniform(-0.4, 0.0), random.uniform(-0.2, 0.2), random.uniform(0.4, 1.0)])
    return look_at(eye, np.array([far_m, random.uniform(-0.3, 0.3), random.uniform(0.1, 0.5)]), _UP)


# Errors are clipped to this: mismatches of tens of pixels, which no noise model has, would outweigh all others.
_MOST_PX = 2.0
_QUANTILES = (np.arange(1000) + 0.5) / 1000.0


@dataclass(frozen=True)
class Distance:
    """How much the errors of two kinds of depth differ. error_px: 1-Wasserstein distance between the distributions of
    their disparity errors over measured pixels, each error clipped to 2 px. holes: difference of their shares of pixels
    without depth."""

    error_px: float
    holes: float

    @property
    def total(self) -> float:
        """Returns error_px + holes: a pixel without depth weighs as much as an error of 1 px."""
        return self.error_px + self.holes


def distance(views: Views, depth_m: NDArray[np.float32]) -> Distance:
    """Returns the Distance between depth_m and the views' measured depth, as a mean over the rooms. depth_m: [rooms,
    height, width] metres, 0 = none."""
    rooms = []
    for truth, found, depth in zip(views.truth_m, views.found_m, depth_m, strict=True):
        is_there = (truth >= views.near_m) & (truth <= views.far_m)
        errors, holes = [], []
        for image in (found, depth):
            is_valid = is_there & (image > 0)
            px = views.focal_baseline_px_m * (1.0 / image[is_valid].astype(np.float64) - 1.0 / truth[is_valid])
            errors.append(np.quantile(np.clip(px, -_MOST_PX, _MOST_PX), _QUANTILES) if px.size else np.zeros(1000))
            holes.append(1.0 - is_valid.sum() / max(int(is_there.sum()), 1))
        rooms.append((float(np.mean(np.abs(errors[0] - errors[1]))), float(abs(holes[0] - holes[1]))))
    error_px, difference = np.mean(rooms, axis=0)
    return Distance(float(error_px), float(difference))


_BAND, _PERIOD = 8, 64
_MOST_EVALUATIONS = 120


@dataclass(frozen=True)
class Profile(ABC):
    """A simulator's noise model for depth, with its parameters. Without arguments it has the simulator's default
    parameters."""

    FILE: ClassVar[str]
    LACKS: ClassVar[tuple[str, ...]]  # properties without a parameter in the model, one line each
    # Parameters that are fitted: {name: (low, high, start)}.
    FITTED: ClassVar[dict[str, tuple[float, float, float]]]

    @abstractmethod
    def apply(self, views: Views, random: np.random.Generator) -> NDArray[np.float32]:
        """Returns the views' true depth with the model's noise, [rooms, height, width] metres, 0 = none."""

    @classmethod
    @abstractmethod
    def known(cls, views: Views) -> Profile:
        """Returns the profile with the parameters that need no fit, such as range and geometry, taken from the
        views."""

    @abstractmethod
    def file_text(self, views: Views) -> str:
        """Returns the text of the simulator's own file."""


def clipped(truth_m: NDArray[np.float32], noisy_m: NDArray[Any], near_m: float, far_m: float) -> NDArray[np.float32]:
    """Returns noisy_m, made positive, where the true depth lies in the range, else 0."""
    is_kept = (truth_m >= near_m) & (truth_m <= far_m)
    return np.where(is_kept, np.maximum(noisy_m, 1e-3), 0.0).astype(np.float32)


def fitted(kind: type[Profile], views: Views) -> Profile:
    """Fits a model's parameters to the sensor's views by minimising distance()'s total, and returns the profile."""
    is_kept = np.arange(views.truth_m.shape[1]) % _PERIOD < _BAND  # enough for noise that reaches few rows
    rows = replace(views, **{name: getattr(views, name)[:, is_kept] for name in ("truth_m", "found_m", "gray")})
    start = kind.known(views)
    low, high, first = (np.array(values) for values in zip(*kind.FITTED.values(), strict=True))

    def made(unit: NDArray[np.float64]) -> Profile:
        values = low + np.clip(unit, 0.0, 1.0) * (high - low)
        return replace(start, **dict(zip(kind.FITTED, map(float, values), strict=True)))

    def loss(unit: NDArray[np.float64]) -> float:
        outside = float(np.sum(np.abs(unit - np.clip(unit, 0.0, 1.0))))
        return distance(rows, made(unit).apply(rows, np.random.default_rng(0))).total + outside

    begin = (first - low) / (high - low)
    simplex = np.vstack([begin, begin + 0.3 * np.where(begin < 0.5, 1.0, -1.0) * np.eye(len(begin))])
    options = {"initial_simplex": simplex, "maxfev": _MOST_EVALUATIONS, "xatol": 1e-3, "fatol": 1e-5}
    return made(minimize(loss, begin, method="Nelder-Mead", options=options).x)
