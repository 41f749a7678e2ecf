# SPDX-License-Identifier: Apache-2.0
"""Fits other simulators' noise models, which are simpler, to a simulated sensor in random rooms. Writes them as files
of those simulators, and measures their distance from the sensor in rooms that no fit used."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.output_files import write_json, write_text
from activestereo.common.pose import CAMERA_TO_BODY, Pose, look_at, rigid_motion
from activestereo.common.progress_bar import Progress, silent
from activestereo.model import SensorModel
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import add_mesh
from activestereo.sensor.depth_modes import IsaacSettings, isaac
from activestereo.sensor.sensor import StereoDepthSensor

# Errors are clipped to this: mismatches of tens of pixels, which no noise model has, would outweigh all others.
_MOST_PX = 2.0
_QUANTILES = (np.arange(1000) + 0.5) / 1000.0
# The fit uses _BAND of every _PERIOD rows, which suffices for noise that correlates over few rows.
_BAND, _PERIOD = 8, 64
_MOST_EVALUATIONS = 120
_ROOMS = 6
# First seed of the rooms that no fit saw; rooms of the fit have seeds from 0.
_HELD_OUT_SEED = 2**40

Depths = NDArray[np.float32]


@dataclass(frozen=True)
class Views:
    """Views of rooms by a sensor's left camera. truth_m, found_m: true and measured depth, float32 [rooms, height,
    width] metres, 0 = no surface, or not measured. gray: the surfaces' reflectance 0..1, float32 of the same shape. k:
    3x3, pixels. near_m, far_m: the sensor's range of depth."""

    truth_m: Depths
    found_m: Depths
    gray: Depths
    k: NDArray[np.float64]
    baseline_m: float
    near_m: float
    far_m: float

    @property
    def focal_baseline_px_m(self) -> float:
        return float(self.k[0, 0]) * self.baseline_m


def take_views(
    config: StereoDepthSensorConfig, model: SensorModel | None, count: int, seed: int, device: str | int = "auto",
    progress: Progress = silent,
) -> Views:  # fmt: skip
    """Simulates the sensor in `count` random rooms and returns their Views. model: its effects act, except those on
    named surfaces, because these rooms lack such surfaces."""
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
        progress((number + 1) / count)
    truth, found, gray = (np.stack(images).astype(np.float32) for images in zip(*taken, strict=True))
    k = np.array(config.rgb_intrinsic, np.float64)
    return Views(truth, found, gray, k, config.baseline_m, config.min_depth_m, config.max_depth_m)


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
    lamp_to_world = rigid_motion(random.uniform([-0.5, -0.5, 1.5], [1.5, 0.5, 2.5]))
    power = random.uniform(0.1, 1.5)
    scene.add_light(kuafu.Light(kind="point", intensity=(power,) * 3, light_to_world=lamp_to_world))
    eye = np.array([random.uniform(-0.4, 0.0), random.uniform(-0.2, 0.2), random.uniform(0.4, 1.0)])
    return look_at(eye, np.array([far_m, random.uniform(-0.3, 0.3), random.uniform(0.1, 0.5)]), np.eye(3)[2])


class Distance(NamedTuple):
    """Measures how much the errors of two depth images differ. error_px: 1-Wasserstein distance between the
    distributions of their disparity errors over measured pixels, each error clipped to 2 px. holes: difference of their
    shares of pixels without depth."""

    error_px: float
    holes: float


def distance(views: Views, depth_m: Depths) -> Distance:
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
        rooms.append((np.mean(np.abs(errors[0] - errors[1])), abs(holes[0] - holes[1])))
    return Distance(*map(float, np.mean(rooms, axis=0)))


def fitted(kind: type[Profile], views: Views) -> Profile:
    """Fits a noise model's parameters to the sensor's views and returns the model. The fit minimises distance()'s
    error_px plus holes, so that a pixel without depth weighs as much as an error of 1 px. Range and geometry are the
    views'."""
    is_kept = np.arange(views.truth_m.shape[1]) % _PERIOD < _BAND
    rows = replace(views, **{name: getattr(views, name)[:, is_kept] for name in ("truth_m", "found_m", "gray")})
    low, high, first = np.transpose(list(kind.FITTED.values()))

    def made(unit: NDArray[np.float64]) -> Profile:
        values = low + np.clip(unit, 0.0, 1.0) * (high - low)
        return kind(**dict(zip(kind.FITTED, map(float, values), strict=True)), **kind.known(views))

    def loss(unit: NDArray[np.float64]) -> float:
        outside = float(np.sum(np.abs(unit - np.clip(unit, 0.0, 1.0))))
        return sum(distance(rows, made(unit).apply(rows, np.random.default_rng(0)))) + outside

    begin = (first - low) / (high - low)
    simplex = np.vstack([begin, begin + 0.3 * np.where(begin < 0.5, 1.0, -1.0) * np.eye(len(begin))])
    options = {"initial_simplex": simplex, "maxfev": _MOST_EVALUATIONS, "xatol": 1e-3, "fatol": 1e-5}
    return made(minimize(loss, begin, method="Nelder-Mead", options=options).x)


@dataclass(frozen=True)
class Isaac:
    """The noise model of Isaac Sim's single-view depth sensor, written as a USD layer. Like all PROFILES it has its
    default parameters if made without arguments.

    The attributes, their meaning and their defaults are from NVIDIA, ovrtx 0.7.0, "Camera single-view stereo depth
    model" (pages "USD Attributes" and "Tune Noise, Quantization and Confidence"), and from the example of
    OmniSensorDepthSensorSingleViewAPI in the RTX sensors' documentation. Up to Isaac Sim 6 their names are
    omni:rtx:post:depthSensor:* of a RenderProduct, in ovrtx 0.7 omni:sensor:depthSensor:* of a Camera. The layer has
    both.

    confidence: 0.7 by default, which drops surfaces without texture; 0 drops nothing.
    """

    FILE: ClassVar = "isaac.usda"
    LACKS: ClassVar = (
        "bias: noise has no mean, noiseMean being the step of disparity",
        "holes of dark, glossy and saturated surfaces: with confidenceThreshold 0 holes come from occlusion and range",
        "errors that neighbours share, and that grow where the pattern is dim",
    )
    # {name: (low, high, start)} of the parameters that are fitted.
    FITTED: ClassVar = {"step_px": (0.01, 1.0, 0.1), "sigma_px": (0.0, 1.5, 0.3)}

    step_px: float = 0.25
    sigma_px: float = 0.25
    max_disparity_px: float = 110.0
    min_distance_m: float = 0.5
    max_distance_m: float = 9999.9
    confidence: float = 0.7

    @staticmethod
    def known(views: Views) -> dict[str, float]:
        """Returns the parameters that follow from the sensor's range and geometry, so that they need no fit."""
        most = views.focal_baseline_px_m / views.near_m
        own = {"max_disparity_px": most, "min_distance_m": views.near_m, "max_distance_m": views.far_m}
        return own | {"confidence": 0.0}

    def apply(self, views: Views, random: np.random.Generator) -> Depths:
        """Returns the views' true depth with the model's noise, [rooms, height, width] metres, 0 = none."""
        near = np.where(views.truth_m <= self.max_distance_m, views.truth_m, np.float32(0.0))
        settings = IsaacSettings(
            self.step_px, self.sigma_px, self.max_disparity_px, self.min_distance_m, self.confidence > 0.0
        )
        return isaac(near, views.gray, float(views.k[0, 0]), views.baseline_m, settings, random)

    def file_text(self, views: Views) -> str:
        """Returns the text of the simulator's own file."""
        values = {
            "baselineMM": views.baseline_m * 1000.0, "focalLengthPixel": float(views.k[0, 0]),
            "sensorSizePixel": float(views.truth_m.shape[2]), "maxDisparityPixel": self.max_disparity_px,
            "noiseMean": self.step_px, "noiseSigma": self.sigma_px, "noiseDownscaleFactorPixel": 1.0,
            "confidenceThreshold": self.confidence, "minDistance": self.min_distance_m,
            "maxDistance": self.max_distance_m,
        }  # fmt: skip
        lines = ["#usda 1.0"]
        for head, schema, space in (
            ('RenderProduct "DepthSensor"', "OmniSensorDepthSensorSingleViewAPI", "omni:rtx:post:depthSensor"),
            ('Camera "DepthCamera"', "OmniSensorGenericDepthSensorSingleViewAPI", "omni:sensor:depthSensor"),
        ):
            lines += ["", f"def {head} (", f'    prepend apiSchemas = ["{schema}"]', ")", "{"]
            lines += [f"    bool {space}:enabled = 1"] * head.startswith("RenderProduct")
            lines += [*(f"    float {space}:{key} = {value:.6g}" for key, value in values.items()), "}"]
        return "\n".join([*lines, ""])


def _clipped(views: Views, noise_m: NDArray[Any], near_m: float, far_m: float) -> Depths:
    """Returns true depth plus noise, at least 1 mm, where the true depth is within near_m to far_m; 0 elsewhere."""
    is_kept = (views.truth_m >= near_m) & (views.truth_m <= far_m)
    return np.where(is_kept, np.maximum(views.truth_m + noise_m, 1e-3), 0.0).astype(np.float32)


@dataclass(frozen=True)
class Gazebo:
    """The noise model of Gazebo's depth camera, written as SDF.

    SDFormat's <camera> has <clip> and one additive Gaussian <noise> of mean and stddev, the same at all depths
    (gz-sensors, ImageGaussianNoiseModel; gz-sensors#416 asks for more). Without <noise> depth is exact.
    """

    FILE: ClassVar = "gazebo.sdf"
    LACKS: ClassVar = (
        "noise that grows with depth: one stddev in metres is too much near by and too little far away",
        "holes, other than what is nearer or farther than the clip planes",
        "steps of disparity, and errors that neighbours share",
    )
    FITTED: ClassVar = {"mean_m": (-0.05, 0.05, 0.0), "stddev_m": (0.0, 0.2, 0.02)}

    mean_m: float = 0.0
    stddev_m: float = 0.0
    near_m: float = 0.1
    far_m: float = 100.0

    @staticmethod
    def known(views: Views) -> dict[str, float]:
        return {"near_m": views.near_m, "far_m": views.far_m}

    def apply(self, views: Views, random: np.random.Generator) -> Depths:
        noise = self.mean_m + self.stddev_m * random.standard_normal(views.truth_m.shape, np.float32)
        return _clipped(views, noise, self.near_m, self.far_m)

    def file_text(self, views: Views) -> str:
        height, width = views.truth_m.shape[1:]
        (fx, _, cx), (_, fy, cy), _ = views.k
        return f"""<?xml version="1.0"?>
<sdf version="1.9">
  <model name="depth_camera">
    <link name="link">
      <sensor name="depth_camera" type="depth_camera">
        <camera>
          <horizontal_fov>{2.0 * np.arctan(width / (2.0 * fx)):.6f}</horizontal_fov>
          <image><width>{width}</width><height>{height}</height><format>R_FLOAT32</format></image>
          <clip><near>{self.near_m:.6g}</near><far>{self.far_m:.6g}</far></clip>
          <lens><intrinsics><fx>{fx:.6g}</fx><fy>{fy:.6g}</fy><cx>{cx:.6g}</cx><cy>{cy:.6g}</cy><s>0</s></intrinsics></lens>
          <noise><type>gaussian</type><mean>{self.mean_m:.6g}</mean><stddev>{self.stddev_m:.6g}</stddev></noise>
        </camera>
      </sensor>
    </link>
  </model>
</sdf>
"""


@dataclass(frozen=True)
class ElevationMapping:
    """elevation_mapping's variances of a depth camera's points, written as its YAML file.

    Its structured-light sensor (Nguyen, Izadi and Lovell, 3DIMPVT 2012; ANYbotics/elevation_mapping,
    StructuredLightSensorProcessor) has a standard deviation along the ray, a + b (z - c)^2 + d z^e in metres, one
    across it, lateral_factor z, and cutoffs of depth. The defaults are its realsense_d435.yaml.
    """

    FILE: ClassVar = "elevation_mapping.yaml"
    LACKS: ClassVar = (
        "holes: it takes the points that there are",
        "bias, steps of disparity, and errors that neighbours share: variances of points are added as if independent",
        "the spread across the ray is not fitted: lateral_factor is a pixel's width",
    )
    FITTED: ClassVar = {"a": (0.0, 0.02, 0.002), "b": (0.0, 0.1, 0.01), "c": (-1.0, 1.0, 0.3)}

    a: float = 0.00241809
    b: float = 0.00662547
    c: float = 0.77199589
    lateral_factor: float = 0.00220941
    near_m: float = 0.35
    far_m: float = 3.0

    @staticmethod
    def known(views: Views) -> dict[str, float]:
        return {"lateral_factor": 1.0 / float(views.k[0, 0]), "near_m": views.near_m, "far_m": views.far_m}

    def apply(self, views: Views, random: np.random.Generator) -> Depths:
        sigma_m = self.a + self.b * (views.truth_m - self.c) ** 2
        noise = sigma_m * random.standard_normal(views.truth_m.shape, np.float32)
        return _clipped(views, noise, self.near_m, self.far_m)

    def file_text(self, views: Views) -> str:
        return f"""sensor_processor/type: structured_light
sensor_processor/cutoff_min_depth: {self.near_m:.8g}
sensor_processor/cutoff_max_depth: {self.far_m:.8g}
sensor_processor/normal_factor_a: {self.a:.8g}
sensor_processor/normal_factor_b: {self.b:.8g}
sensor_processor/normal_factor_c: {self.c:.8g}
sensor_processor/normal_factor_d: 0
sensor_processor/normal_factor_e: 1
sensor_processor/lateral_factor: {self.lateral_factor:.8g}
"""


Profile = Isaac | Gazebo | ElevationMapping
PROFILES: dict[str, type[Profile]] = {"isaac": Isaac, "gazebo": Gazebo, "elevation_mapping": ElevationMapping}


def export(
    config: StereoDepthSensorConfig, model: SensorModel | None, names: list[str], out: Path, held_out: int = 0,
    seed: int = 0, device: str | int = "auto", progress: Progress = silent,
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Fits the named PROFILES to the sensor, writes their files and profiles.json, and returns the latter's contents.
    For each model these are its file, its parameters, what it cannot express, and the Distance from the sensor in rooms
    outside the fit, with default and with fitted parameters. held_out: number of these rooms; 0: no distances.
    progress: called with the fraction of rooms that are simulated, first for the fit's rooms, then for the others."""
    views = take_views(config, model, _ROOMS, seed, device, progress)
    others = take_views(config, model, held_out, _HELD_OUT_SEED + seed, device, progress) if held_out else None
    found = {}
    for name in names:
        profile = fitted(PROFILES[name], views)
        write_text(out / profile.FILE, profile.file_text(views))
        far = {} if others is None else {
            kind: distance(others, one.apply(others, np.random.default_rng(1)))._asdict()
            for kind, one in (("default", PROFILES[name]()), ("exported", profile))
        }  # fmt: skip
        told = {"file": profile.FILE, "parameters": asdict(profile), "lacks": list(profile.LACKS), "held_out": far}
        found[name] = told
    write_json(out / "profiles.json", found)
    return found
