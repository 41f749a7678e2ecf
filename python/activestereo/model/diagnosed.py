# SPDX-License-Identifier: Apache-2.0
"""Makes the sensor model of a diagnosed capture, and replaces a capture's nominal calibration and pattern by a
model's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Capture
from activestereo.capture.images import read_gray
from activestereo.common.pattern import spots_image
from activestereo.effects.core.model import Model
from activestereo.effects.core.surfaces import SURFACES
from activestereo.model.model import (
    NUISANCES,
    Imager,
    MeasuredPose,
    Pattern,
    Quantity,
    Rig,
    SensorModel,
    with_surfaces,
)


def calibrated(capture: Capture, model: SensorModel) -> Capture:
    """Returns the capture with the model's K, lenses, baseline, projector, pattern and poses; parts that the model
    lacks stay. Raises ValueError if the model is for another image size."""
    rig = capture.rig
    if model.rig is not None:
        for name, camera, side in (("left", rig.left, model.rig.left), ("right", rig.right, model.rig.right)):
            if camera.size != side.size:
                raise ValueError(
                    f"the model's {name} camera is {side.width}x{side.height}, {capture.path} has "
                    f"{camera.width}x{camera.height}: calibrate the rig at the size that is recorded"
                )
        own = model.rig
        rig = replace(rig, left=own.left, right=own.right, left_to_right=own.left_to_right)
        if model.rig.left_to_projector is not None:
            rig = replace(rig, projector=replace(rig.projector, left_to_projector=model.rig.left_to_projector))
    if model.pattern is not None:
        measured = replace(rig.projector, K=model.pattern.K, measured=pattern_image(model.pattern))
        rig = replace(rig, projector=measured)
    measured_of = {pose.stated.tobytes(): pose.measured for pose in model.poses}
    poses = (measured_of.get(f.camera_to_world.tobytes(), f.camera_to_world) for f in capture.frames)
    frames = tuple(replace(f, camera_to_world=pose) for f, pose in zip(capture.frames, poses, strict=True))
    return replace(capture, rig=rig, frames=frames)


def pattern_image(pattern: Pattern) -> NDArray[np.float32]:
    """Returns the pattern's relative radiant intensity [height, width], 1 at the brightest pixel. It is read from the
    file, or is a background plus one Gaussian per dot, whose integral is the dot's power."""
    if pattern.dots is None:
        assert pattern.file is not None
        return read_gray(pattern.file, key="pattern.file").astype(np.float32) / 255.0
    assert pattern.size is not None and pattern.dot_sigma_px is not None
    (width, height), sigma = pattern.size, pattern.dot_sigma_px
    u, v, power = pattern.dots.T
    image = spots_image(u, v, power / (2.0 * np.pi * sigma**2), sigma, width, height) + pattern.background
    return (image / max(float(image.max()), 1e-12)).astype(np.float32)


def found_effect(diagnosis: Mapping[str, Any], effect_id: str) -> tuple[dict[str, Quantity], tuple[str, ...]]:
    """Reads an effect's parameters from a diagnosis' JSON: ({parameter: Quantity}, names of the surfaces that show it;
    () = all). Values of the accepted model take precedence over those of the ranking. Raises ValueError if the
    diagnosis has neither."""
    ranked = {e.get("effect"): e for e in diagnosis.get("ranking", [])}
    accepted = {e.get("id"): e for e in reversed(diagnosis.get("model", {}).get("effects", []))}
    found = accepted.get(effect_id) or ranked.get(effect_id)
    if found is None:
        raise ValueError(f"the diagnosis has no parameters of '{effect_id}'")
    out, named = {}, found.get("surfaces")
    for name, value in found["parameters"].items():
        if name != SURFACES.name:
            entry = value if isinstance(value, Mapping) else {"value": value}
            ends = entry.get("low"), entry.get("high")
            out[name] = Quantity(entry["value"], *ends, entry.get("unit", "1"), "diagnosis")
    if named is None:
        named = ranked.get(effect_id, {}).get("parameters", {}).get(SURFACES.name, {}).get("materials", [])
    return out, tuple(named)


Interval = tuple[float | None, float | None]


def diagnosed_model(
    capture: Capture,
    effects: Model,
    nuisances: Mapping[str, float] | None = None,
    noise: Mapping[str, float] | None = None,
    albedo: Mapping[str, float] | None = None,
    intervals: Mapping[tuple[str, str], Interval] | None = None,
    material_names: Sequence[str] = (),
    poses: Sequence[MeasuredPose] = (),
) -> SensorModel:
    """Makes the SensorModel of a diagnosis.

    effects: the effects found. nuisances: values by names of model.model.NUISANCES. noise: values by names of
    model.model.NOISE_TERMS; None: unknown. albedo: {material name: factor on its nominal infrared albedo}. intervals:
    {(owner, parameter): 90 % interval}; an owner is an effect's id, 'nuisances' or a material's name. material_names:
    the scene's materials by id. poses: measured poses of views that differ from the stated ones."""
    bounds, source = intervals or {}, f"diagnosis of {capture.name}"

    def quantity(owner: str, name: str, value: float, unit: str) -> Quantity:
        return Quantity(float(value), *bounds.get((owner, name), (None, None)), unit=unit, source=source)

    rig, frames = capture.rig, capture.split("train") or list(capture.frames)
    usual = sorted(frames, key=lambda frame: frame.exposure_gain)[len(frames) // 2]
    model = SensorModel(
        rig=Rig.of_capture(rig, usual.exposure_s, usual.gain, f"nominal, of {capture.name}"),
        pattern=Pattern(rig.projector.K, file=rig.projector.pattern_path, source=f"nominal, of {capture.name}"),
        imager=None if noise is None else Imager.of_values(noise, source),
        materials={
            name: {"ir_albedo_factor": quantity(name, "ir_albedo_factor", factor, "1")}
            for name, factor in (albedo or {}).items()
        },
        nuisances={
            name: quantity("nuisances", name, value, NUISANCES[name][0]) for name, value in (nuisances or {}).items()
        },
        poses=tuple(poses),
        source=source,
    )
    for effect, parameters in effects.effects:
        units = {p.name: p.unit for p in effect.parameters}
        values, surfaces = with_surfaces(effect, parameters, material_names)
        model = model.with_effect(effect, {n: quantity(effect.id, n, v, units[n]) for n, v in values.items()}, surfaces)
    return model
