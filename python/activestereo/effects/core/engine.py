# SPDX-License-Identifier: Apache-2.0
"""The inputs of the two engines for one exposure, and how an effect says which of it it moves.

    @moves("optics.vignetting_exponent")
    def _engine(inputs: EngineInputs, exponent: float) -> None:
        for side in inputs.sides:
            side.optics.vignetting_exponent += exponent

An effect's `engine` function changes EngineInputs in place; its keyword arguments are the effect's parameters. moved.py
makes images of the moved fields without a render. Records are kuafu's own (kuafu.Camera, kuafu.Optics, kuafu.Light,
kuafu.Material, kuafu.Medium), a signal is a dict of simsense_signal's fields, so a wrong field name is an error.
Nothing here imports an engine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from activestereo.capture.capture import Frame
from activestereo.effects.core.resample import blur
from activestereo.effects.core.surfaces import material_numbers
from activestereo.effects.core.view import random_stream

if TYPE_CHECKING:
    import kuafu

REFERENCE_TEMPERATURE_C = 25.0


# The share of the projector's light that is left at tangents (x, y) of angles from its axis.
PatternGain = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def moves(*fields: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Marks an effect's engine function with the names of the engine fields that it moves; a test compares them with
    what it does."""

    def mark(function: Callable[..., None]) -> Callable[..., None]:
        function.fields = fields  # type: ignore[attr-defined]
        return function

    return mark


@dataclass
class EngineCamera:
    """One infrared camera: what kuafu sees through it, and the imager behind it. signal: simsense_signal's fields by
    name."""

    camera: kuafu.Camera
    optics: kuafu.Optics
    signal: dict[str, float]
    is_right: bool
    delay_s: float = 0.0

    def move(self, x_m: float) -> None:
        """Stands x_m further along its own x axis."""
        step = np.eye(4)
        step[0, 3] = x_m
        self.camera.camera_to_world = self.camera.camera_to_world @ step

    def turn(self, axis: tuple[float, float, float], angle_rad: float) -> None:
        """Turns about an axis (unit) of its own frame, right-handed."""
        turned = np.eye(4)
        turned[:3, :3] = rotation(axis, angle_rad)
        self.camera.camera_to_world = self.camera.camera_to_world @ turned

    def shift_image(self, u_px: float, v_px: float) -> None:
        """Everything is drawn u_px further right and v_px lower."""
        k = self.camera.k
        k[:2, 2] += u_px, v_px
        self.camera.k = k

    def scale_focal(self, factor: float) -> None:
        """Both focal lengths grow; the principal point stays."""
        k = self.camera.k
        k[:2, :2] *= factor
        self.camera.k = k

    def add_distortion(self, k1: float = 0.0, k2: float = 0.0, p1: float = 0.0, p2: float = 0.0) -> None:
        """Adds to the nominal lens' coefficients: the composition of both lenses to first order."""
        first, second, third, fourth, *others = self.camera.distortion
        k3, k4, k5, k6 = others
        self.camera.distortion = (first + k1, second + k2, third + p1, fourth + p2, k3, k4, k5, k6)

    def electrons(self, dn: float) -> float:
        """Charge before the amplifier that gives so many counts behind it."""
        return dn / (self.signal["conversion_gain_dn_per_e"] * self.signal["gain"])

    def add_variance(self, name: str, deviation: float) -> None:
        """Adds independent noise to a standard deviation of the signal."""
        self.signal[name] = float(np.hypot(self.signal[name], deviation))


@dataclass
class EngineInputs:
    """All inputs of the engines for one exposure of a rig, as the calibration has it until effects change
    it.

    projector: the rig's own, None where there is none; its texture is `pattern`, relative radiant intensity
    [height][width] 0..1 (None where it projects dots). rig_lights: further ones that move with the rig; lights: those
    that stand in the world; both made by new_light. medium: made by new_medium. ambient_radiance: of the capture's or
    room's infrared light, in the unit of the lights' intensities per steradian. scene_materials: id -> a fresh
    kuafu.Material of the scene. matcher: simsense's parameters. bounds_m: a box around the scene and the rig, world.
    speckle_of_laser: only the projectors' light has speckle. frame: exposure, gain, time, temperature.
    """

    left: EngineCamera
    right: EngineCamera
    projector: kuafu.Light | None
    pattern: NDArray[np.float32] | None
    frame: Frame
    new_light: Callable[..., kuafu.Light]
    new_medium: Callable[..., kuafu.Medium]
    scene_materials: Callable[[int], kuafu.Material]
    material_count: int
    bounds_m: tuple[tuple[float, ...], tuple[float, ...]]
    max_dn: float = 255.0
    seed: int = 0
    ambient_radiance: float = 1.0
    lights: list[kuafu.Light] = field(default_factory=list)
    rig_lights: list[kuafu.Light] = field(default_factory=list)
    medium: kuafu.Medium | None = None
    materials: dict[int, kuafu.Material] = field(default_factory=dict)
    speckle_of_laser: bool = False
    matcher: dict[str, float] = field(default_factory=dict)

    @property
    def sides(self) -> tuple[EngineCamera, EngineCamera]:
        return self.left, self.right

    @property
    def warming_k(self) -> float:
        """Kelvin above the reference temperature; 0 where the temperature is not known."""
        return 0.0 if self.frame.temperature_c is None else self.frame.temperature_c - REFERENCE_TEMPERATURE_C

    def surfaces(self, chosen: float) -> Iterator[kuafu.Material]:
        """The materials of a sum of 2^id, all of them for 0; what is changed on them is what the scene gets."""
        for number in material_numbers(chosen) or range(self.material_count):
            yield self.material(number)

    def material(self, number: int) -> kuafu.Material:
        """One of the scene's materials; what is changed on it is what the scene gets."""
        if number not in self.materials:
            self.materials[number] = self.scene_materials(number)
        return self.materials[number]

    @property
    def added_lights(self) -> list[kuafu.Light]:
        """Lights that effects add to the scene's own."""
        return [*self.rig_lights, *self.lights]

    def add_light(self, *, on_rig: bool, **fields: Any) -> None:
        """One more light, on the rig or standing in the world; `fields` are kuafu.Light's."""
        (self.rig_lights if on_rig else self.lights).append(self.new_light(**fields))

    def add_unit(
        self, *, on_rig: bool, name: str, light_to_world: NDArray[np.float64], intensity_m2: float, **fields: Any
    ) -> None:
        """Another projector with the own one's pattern; intensity_m2: radiant intensity over ambient radiance. `fields`
        are more of kuafu.Light's. Without an own projector, or of no intensity, there is none."""
        own = self.projector
        if own is None or intensity_m2 == 0.0:
            return
        self.add_light(
            on_rig=on_rig, kind="projector", name=name, k=own.k, light_to_world=light_to_world,
            ir_intensity=intensity_m2 * self.ambient_radiance,
            pattern_scale=own.pattern_scale, dots=own.dots, pattern_width=own.pattern_width,
            pattern_height=own.pattern_height,
            dot_sigma_px=own.dot_sigma_px, dot_background=own.dot_background, **fields,
        )  # fmt: skip

    def fill_with(self, **fields: Any) -> None:
        """Fills the scene with a medium; `fields` are kuafu.Medium's."""
        self.medium = self.new_medium(**fields)

    def dim_pattern(self, gain: PatternGain) -> None:
        """Multiplies the projector's pattern image by a gain, where there is one."""
        if self.projector is None or self.pattern is None:
            return
        K, (height, width) = self.projector.k, self.pattern.shape
        v, u = np.mgrid[0:height, 0:width]
        y = (v - K[1, 2]) / K[1, 1]
        x = (u - K[0, 2] - K[0, 1] * y) / K[0, 0]
        self.pattern = (self.pattern * gain(x, y)).astype(np.float32)

    def blur_pattern(self, sigma_px: float) -> None:
        """Blurs the projector's dots by a Gaussian of so many camera pixels: the same angle at the projector."""
        if self.projector is None or sigma_px == 0.0:
            return
        sigma_px *= self.projector.k[0, 0] / self.left.camera.k[0, 0]
        if self.pattern is None:
            self.projector.dot_sigma_px = float(np.hypot(self.projector.dot_sigma_px, sigma_px))
        else:
            self.pattern = blur(self.pattern, sigma_px)

    def add_speckle(self, contrast: float, static_share: float) -> None:
        """Multiplies light by independent grains, mean 1; static_share of their variance stays while rig and scene
        stand still. Gamma variates of one scale add up to another one, so that the shares of variance are those of the
        shape."""
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
        """Random numbers of the whole rig for one effect: the same as View.rng(name, per='rig') gives."""
        return random_stream(self.seed, name)


def rotation(axis: tuple[float, float, float], angle_rad: float) -> NDArray[np.float64]:
    """3x3, right-handed about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=np.float64)
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross


def moved_pose(
    pose: NDArray[np.float64], linear: Sequence[float], angular: Sequence[float], time_s: float
) -> NDArray[np.float64]:
    """4x4 of what stands at `pose` at time 0 with a twist in its own frame, m/s and rad/s: pose exp(t [v, w])."""
    if time_s == 0.0:
        return pose.copy()
    generator = np.zeros((4, 4))
    x, y, z = angular
    generator[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    generator[:3, 3] = linear
    return pose @ expm(time_s * generator)


def apply_engine(
    inputs: EngineInputs, effects: tuple[tuple[Any, dict[str, float]], ...]
) -> tuple[tuple[Any, dict[str, float]], ...]:
    """Lets effects, pairs (Effect, {parameter: value}), change the inputs in the pipeline's order; returns those that
    no engine field expresses."""
    left = []
    for effect, parameters in sorted(effects, key=lambda pair: pair[0].stage):
        if effect.engine is None:
            left.append((effect, parameters))
        elif parameters != effect.neutral_values:
            effect.engine(inputs, **parameters)
    return tuple(left)
