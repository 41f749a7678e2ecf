# SPDX-License-Identifier: Apache-2.0
"""A complete sensor model as plain data: calibration, pattern, imager, effects, materials and a fit's nuisance
parameters, with intervals and sources. Units are metres, seconds, radians and digital numbers (DN). Every section may
be absent; the simulator then keeps its own values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Camera
from activestereo.capture.capture import Rig as CaptureRig
from activestereo.effects.core.descriptor import Effect
from activestereo.effects.core.model import Model
from activestereo.effects.core.surfaces import SURFACES, material_numbers, material_of, names_of, numbers_of
from activestereo.effects.engines.capture_inputs import SceneMeasurement

# Nuisances of a fit, with units: {name: (unit, low, high)}.
NUISANCES: dict[str, tuple[str, float, float]] = {
    "projector_scale": ("DN sr/(W s)", 0.0, np.inf),
    "ambient_scale": ("DN sr m^2/(W s)", 0.0, np.inf),
    "black_dn": ("DN", -65535.0, 65535.0),
    "focal_left": ("1", -0.2, 0.2),
    "focal_right": ("1", -0.2, 0.2),
}
# Terms of the imager's noise model, with units.
NOISE_TERMS: dict[str, str] = {"offset": "DN^2", "shot": "DN", "relative": "1"}
# Known properties of a material by its glTF name: {field: (unit, low, high)}. All except the factor are fields of
# kuafu.Material.
MATERIAL_FIELDS: dict[str, tuple[str, float, float]] = {
    "ir_albedo_factor": ("1", 0.0, 100.0),
    "ir_albedo": ("1", 0.0, 1.0),
    "roughness": ("1", 0.0, 1.0),
    "metallic": ("1", 0.0, 1.0),
    "specular": ("1", 0.0, 1.0),
    "transmission": ("1", 0.0, 1.0),
}


@dataclass(frozen=True)
class Quantity:
    """A value with its unit and source. low, high: its 90 % interval, or None."""

    value: float
    low: float | None = None
    high: float | None = None
    unit: str = "1"
    source: str = ""


@dataclass(frozen=True)
class Rig:
    """The calibration of the two cameras and the projector. 4x4 transforms a_to_b map coordinates in a to coordinates
    in b, in camera axes (x right, y down, z forward). exposure_s, gain: the sensor's usual settings."""

    left: Camera
    right: Camera
    left_to_right: NDArray[np.float64]
    left_to_projector: NDArray[np.float64] | None = None
    bit_depth: int = 8
    line_time_s: float | None = None
    exposure_s: float | None = None
    gain: float | None = None
    source: str = ""

    @classmethod
    def of_capture(
        cls, rig: CaptureRig, exposure_s: float | None = None, gain: float | None = None, source: str = ""
    ) -> Rig:
        """Returns a capture's rig as a Rig. exposure_s, gain: the usual settings, which a capture's rig lacks."""
        to_projector = rig.projector.left_to_projector
        own = rig.left, rig.right, rig.left_to_right, to_projector, rig.bit_depth, rig.line_time_s
        return cls(*own, exposure_s, gain, source)


@dataclass(frozen=True)
class Pattern:
    """The image that the projector casts: an 8-bit image file, or dots [n, 3] of u, v and power. The dots are Gaussians
    of deviation dot_sigma_px in an image of `size` (width, height); the power is a dot's sum over pixels. background:
    value of each pixel without dots, in the same unit. K: the projector's intrinsics, 3x3."""

    K: NDArray[np.float64]
    file: Path | None = None
    dots: NDArray[np.float64] | None = None
    size: tuple[int, int] | None = None
    dot_sigma_px: float | None = None
    background: float = 0.0
    source: str = ""


@dataclass(frozen=True)
class Imager:
    """Temporal noise of the imager: variance in DN^2 = offset + shot * gain * signal + relative * signal^2. The signal
    is in DN above the black level."""

    offset: Quantity
    shot: Quantity
    relative: Quantity

    @classmethod
    def of_values(cls, values: Mapping[str, float], source: str) -> Imager:
        """Makes the Imager of fitted values by names of NOISE_TERMS."""
        return cls(**{n: Quantity(float(values[n]), unit=unit, source=source) for n, unit in NOISE_TERMS.items()})


@dataclass(frozen=True)
class MeasuredPose:
    """The pose of one view: 4x4 camera_to_world of the left camera, as the capture states it and as measured."""

    stated: NDArray[np.float64]
    measured: NDArray[np.float64]


@dataclass(frozen=True)
class ModelEffect:
    """An effect with its parameters. surfaces: names of the materials that show it, () = all. They replace the
    parameter `surfaces`, which holds numbers."""

    effect: Effect
    parameters: Mapping[str, Quantity]
    surfaces: tuple[str, ...] = ()


@dataclass(frozen=True)
class SensorModel:
    """A sensor model. nuisances: {name of NUISANCES: Quantity}. materials: {glTF name: {name of MATERIAL_FIELDS:
    Quantity}}. poses: measured poses of a capture's views that differ from the stated ones. source: text, from where
    the model comes."""

    rig: Rig | None = None
    pattern: Pattern | None = None
    imager: Imager | None = None
    effects: tuple[ModelEffect, ...] = ()
    materials: Mapping[str, Mapping[str, Quantity]] = field(default_factory=dict)
    nuisances: Mapping[str, Quantity] = field(default_factory=dict)
    poses: tuple[MeasuredPose, ...] = ()
    source: str = ""

    def with_effect(
        self, effect: Effect, parameters: Mapping[str, Quantity], surfaces: Sequence[str] = ()
    ) -> SensorModel:
        """Returns a copy with one more effect, or with new parameters of a present one. Raises ValueError for an
        unknown parameter or a value out of range."""
        effect.values({name: q.value for name, q in parameters.items() if name != SURFACES.name})
        kept = tuple(e for e in self.effects if e.effect.id != effect.id)
        values = {name: q for name, q in parameters.items() if name != SURFACES.name}
        return replace(self, effects=(*kept, ModelEffect(effect, values, tuple(surfaces))))

    def bound(self, material_names: Sequence[str]) -> Model:
        """Returns the effects for a scene: surface names are replaced by the scene's surface numbers
        (effects/core/surfaces.py). material_names: the scene's names by number. Raises ValueError with a name that the
        scene lacks."""
        model = Model()
        for entry in self.effects:
            values = {name: q.value for name, q in entry.parameters.items()}
            if entry.surfaces:
                numbers: set[int] = set()
                for name in entry.surfaces:
                    found = numbers_of(name, material_names)
                    if not found:
                        known = ", ".join(material_names) or "none"
                        raise ValueError(f"{entry.effect.id}: the scene has no material '{name}' (there are: {known})")
                    numbers.update(found)
                values[SURFACES.name] = float(sum(2**n for n in numbers))
            model = model.with_effect(entry.effect, **values)
        return model

    @property
    def surfaces(self) -> set[str]:
        """Returns the names of all surfaces to which effects are limited."""
        return {name for entry in self.effects for name in entry.surfaces}

    def scene_measurement(self, material_names: Sequence[str]) -> SceneMeasurement:
        """Returns the fitted focal lengths, albedo factors and material properties for a scene with these materials.
        Materials that the model does not know are left out."""
        left, right = (
            self.nuisances[name].value if name in self.nuisances else 0.0 for name in ("focal_left", "focal_right")
        )
        albedo, surfaces = {}, {}
        for number, name in enumerate(material_names):
            fields = self.materials.get(name) or self.materials.get(material_of(name)) or {}
            values = {field: q.value for field, q in fields.items()}
            if "ir_albedo_factor" in values:
                albedo[number] = values.pop("ir_albedo_factor")
            if values:
                surfaces[number] = values
        return SceneMeasurement((left, right), albedo, surfaces)


def with_surfaces(
    effect: Effect, values: Mapping[str, float], material_names: Sequence[str]
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Splits an effect's parameter values: returns (values without the parameter `surfaces`, names of the materials
    that it selects). Raises ValueError if a selected number has no name."""
    chosen = material_numbers(values.get(SURFACES.name, 0.0)) if SURFACES in effect.parameters else []
    unknown = [n for n in chosen if n >= len(material_names)]
    if unknown:
        raise ValueError(
            f"{effect.id}: the scene has no material number {unknown[0]}, only 0 to {len(material_names) - 1}"
        )
    return {n: v for n, v in values.items() if n != SURFACES.name}, names_of(chosen, material_names)
