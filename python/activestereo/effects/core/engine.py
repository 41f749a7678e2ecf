# SPDX-License-Identifier: Apache-2.0
"""Defines the inputs of both engines for one exposure.

An effect's `engine` function changes EngineInputs in place; its keyword arguments are the effect's parameters. moved.py
makes effects of such functions, and computes images under the changed fields without a render. Records are kuafu's
(kuafu.Camera, kuafu.Optics, kuafu.Light, kuafu.Material, kuafu.Medium). A signal is a dict of simsense_signal's fields,
so a wrong field name is an error. Nothing here runs an engine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.capture.capture import Frame
from activestereo.common.lens import to_tangents
from activestereo.common.pose import rigid_motion
from activestereo.effects.core.resample import blur
from activestereo.effects.core.surfaces import material_numbers
from activestereo.effects.core.view import REFERENCE_TEMPERATURE_C, random_stream

# A function (x, y) -> share of the projector's light that is left. x, y: tangents of the angles from its axis.
PatternGain = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


@dataclass
class EngineCamera:
    """One infrared camera: kuafu's camera and optics, and simsense's imager. signal: simsense_signal's fields by name.
    delay_s: how long after the frame's time it exposes."""

    camera: kuafu.Camera
    optics: kuafu.Optics
    signal: dict[str, float]
    delay_s: float = 0.0

    def move(self, x_m: float) -> None:
        """Moves the camera by x_m along its own x axis."""
        self.camera.camera_to_world = self.camera.camera_to_world @ rigid_motion((x_m, 0.0, 0.0))

    def turn(self, axis: tuple[float, float, float], angle_rad: float) -> None:
        """Turns the camera about a unit axis of its own frame, right-handed."""
        turn = rigid_motion((0.0, 0.0, 0.0), rotation(axis, angle_rad))
        self.camera.camera_to_world = self.camera.camera_to_world @ turn

    def shift_image(self, u_px: float, v_px: float) -> None:
        """Moves the principal point, and so the image, by u_px to the right and v_px down."""
        k = self.camera.k
        k[:2, 2] += u_px, v_px
        self.camera.k = k

    def scale_focal(self, factor: float) -> None:
        """Multiplies this camera's fx and fy (and skew) by a factor, in place; the principal point stays."""
        k = self.camera.k
        k[:2, :2] *= factor
        self.camera.k = k

    def add_distortion(self, k1: float = 0.0, k2: float = 0.0, p1: float = 0.0, p2: float = 0.0) -> None:
        """Adds Brown's coefficients to the nominal lens' own: to first order, the composition of both lenses."""
        first, second, third, fourth, k3, k4, k5, k6 = self.camera.distortion
        self.camera.distortion = (first + k1, second + k2, third + p1, fourth + p2, k3, k4, k5, k6)

    def electrons(self, dn: float) -> float:
        """Returns the electrons before the amplifier that give `dn` digital numbers behind it."""
        return dn / (self.signal["conversion_gain_dn_per_e"] * self.signal["gain"])

    def add_variance(self, name: str, deviation: float) -> None:
        """Adds an independent noise source to the signal's field `name`. deviation: its standard deviation in the
        field's unit; variances add up."""
        self.signal[name] = float(np.hypot(self.signal[name], deviation))


@dataclass
class EngineInputs:
    """All inputs of the engines for one exposure of a rig. They follow the calibration until effects change them.

    projector: the rig's own, or None. pattern: its texture, relative radiant intensity [height][width] 0..1, or None
    where it projects dots. rig_lights: further lights that move with the rig; lights: those that stand in the world.
    ambient_radiance: infrared, in the unit of the lights' intensities per steradian. scene_materials: returns a fresh
    kuafu.Material of the scene by id. materials: {id: changed material}. bounds_m: a box around scene and rig, world.
    speckle_of_laser: only projectors' light has speckle. frame: exposure, gain, time, temperature. unrendered: values
    that images without a render need. `behind`: the radiance behind a clear surface over the ambient radiance. `core`:
    the share of light from below a surface that leaves close to where it entered.
    """

    left: EngineCamera
    right: EngineCamera
    projector: kuafu.Light | None
    pattern: NDArray[np.float32] | None
    frame: Frame
    scene_materials: Callable[[int], kuafu.Material]
    material_count: int
    bounds_m: tuple[tuple[float, ...], ...]
    max_dn: float = 255.0
    seed: int = 0
    ambient_radiance: float = 1.0
    lights: list[kuafu.Light] = field(default_factory=list)
    rig_lights: list[kuafu.Light] = field(default_factory=list)
    medium: kuafu.Medium | None = None
    materials: dict[int, kuafu.Material] = field(default_factory=dict)
    speckle_of_laser: bool = False
    unrendered: dict[str, float] = field(default_factory=dict)

    @property
    def sides(self) -> tuple[EngineCamera, EngineCamera]:
        return self.left, self.right

    @property
    def warming_k(self) -> float:
        """Returns kelvins above the reference temperature of 25 C; 0 where the temperature is not known."""
        return 0.0 if self.frame.temperature_c is None else self.frame.temperature_c - REFERENCE_TEMPERATURE_C

    def surfaces(self, chosen: float) -> Iterator[kuafu.Material]:
        """Yields each chosen material, as material() does. chosen: the sum of 2^id over their ids; 0 = all."""
        for number in material_numbers(chosen) or range(self.material_count):
            yield self.material(number)

    def material(self, number: int) -> kuafu.Material:
        """Returns one of the scene's materials by id. Changes to it reach the scene."""
        if number not in self.materials:
            self.materials[number] = self.scene_materials(number)
        return self.materials[number]

    @property
    def added_lights(self) -> list[kuafu.Light]:
        """Returns the lights that effects have added: first those on the rig, then those in the world."""
        return [*self.rig_lights, *self.lights]

    def add_unit(self, name: str, intensity_m2: float, pose: NDArray[np.float64], *, on_rig: bool) -> None:
        """Adds a second projector with the rig's pattern. intensity_m2: its radiant intensity over the ambient
        radiance, m^2. pose: [4][4], from the rig's projector if it moves with the rig (on_rig), else in the world. Does
        nothing at intensity 0, or if the rig has no projector."""
        own = self.projector
        if own is None or intensity_m2 == 0.0:
            return
        alike = ["k", "pattern_scale", "dots", "pattern_width", "pattern_height", "dot_sigma_px", "dot_background"]
        alike += ["linear_velocity", "angular_velocity"] if on_rig else []
        unit = kuafu.Light(
            kind="projector", name=name, light_to_world=own.light_to_world @ pose if on_rig else pose,
            ir_intensity=intensity_m2 * self.ambient_radiance, **{n: getattr(own, n) for n in alike},
        )  # fmt: skip
        (self.rig_lights if on_rig else self.lights).append(unit)

    def dim_pattern(self, gain: PatternGain) -> None:
        """Multiplies the projector's pattern image by gain(x, y). x, y: tangents of each pixel's angles to the
        projector's axis. Does nothing without a pattern."""
        if self.projector is None or self.pattern is None:
            return
        K, (height, width) = self.projector.k, self.pattern.shape
        v, u = np.mgrid[0:height, 0:width]
        self.pattern = (self.pattern * gain(*to_tangents(u, v, K))).astype(np.float32)

    def blur_pattern(self, sigma_px: float) -> None:
        """Blurs the projector's dots by a Gaussian of sigma_px camera pixels, taken as an angle at the projector."""
        if self.projector is None or sigma_px == 0.0:
            return
        sigma_px *= self.projector.k[0, 0] / self.left.camera.k[0, 0]
        if self.pattern is None:
            self.projector.dot_sigma_px = float(np.hypot(self.projector.dot_sigma_px, sigma_px))
        else:
            self.pattern = blur(self.pattern, sigma_px)

    def add_speckle(self, contrast: float, static_share: float) -> None:
        """Adds speckle: an independent gamma-distributed factor with mean 1 on the projectors' light. contrast: the
        factor's standard deviation. static_share: the share of its variance that stays while rig and scene stand still.
        The variances of repeated calls add up."""
        if contrast == 0.0:
            return
        self.speckle_of_laser = True
        for side in self.sides:
            shape, scale, static = (side.signal[f"speckle_{name}"] for name in ("shape", "scale", "correlation"))
            mean, before = (shape * scale, 1.0 / shape) if shape > 0 else (1.0, 0.0)
            variance = before + contrast**2
            side.signal["speckle_correlation"] = (static * before + static_share * contrast**2) / variance
            side.signal["speckle_shape"], side.signal["speckle_scale"] = 1.0 / variance, mean * variance

    def rng(self, name: str) -> np.random.Generator:
        """Returns one effect's random generator, the same for both cameras and all frames: View.rng(name, "rig")."""
        return random_stream(self.seed, name)


def rotation(axis: tuple[float, float, float], angle_rad: float) -> NDArray[np.float64]:
    """Returns the right-handed rotation [3][3] about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=np.float64)
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross


def towards(azimuth_rad: float, elevation_rad: float) -> np.ndarray:
    """Returns a unit vector, world axes. azimuth: about the world's y axis from z towards x; elevation: above the xz
    plane."""
    level = np.cos(elevation_rad)
    return np.array([level * np.sin(azimuth_rad), np.sin(elevation_rad), level * np.cos(azimuth_rad)])


def axes(azimuth_rad: float, elevation_rad: float, roll_rad: float) -> np.ndarray:
    """Returns the rotation [3][3] from a beam's axes (right, down, along it) to the world's. azimuth: of the beam about
    the world's y axis from z towards x; elevation: above the xz plane; roll: about the beam, right-handed."""
    along = towards(azimuth_rad, elevation_rad)
    right = np.array([-np.cos(azimuth_rad), 0.0, np.sin(azimuth_rad)])
    down = np.cross(along, right)
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    return np.stack([c * right + s * down, c * down - s * right, along], axis=1)


def angles(along: np.ndarray) -> tuple[float, float]:
    """Returns (azimuth, elevation) in radians of a world direction [3], as in axes()."""
    x, y, z = along / np.linalg.norm(along)
    return float(np.arctan2(x, z)), float(np.arcsin(np.clip(y, -1.0, 1.0)))


def apply_engine(
    inputs: EngineInputs, effects: tuple[tuple[Any, dict[str, float]], ...]
) -> tuple[tuple[Any, dict[str, float]], ...]:
    """Applies effects, pairs (Effect, {parameter: value}), to the inputs in the pipeline's order. Returns the pairs
    that the engines do not simulate."""
    left = []
    for effect, parameters in sorted(effects, key=lambda pair: pair[0].stage):
        if not effect.is_simulated(parameters):
            left.append((effect, parameters))
        elif parameters != effect.neutral_values:
            effect.engine(inputs, **parameters)
    return tuple(left)
