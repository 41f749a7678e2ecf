# SPDX-License-Identifier: Apache-2.0
"""Makes the complete sensor model that a diagnosis ends with."""

from collections.abc import Mapping

from activestereo.capture.binning import unbinned
from activestereo.diagnose.answer.albedo_json import albedo_factors, albedo_surfaces
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.refine.geometry_fit import standing
from activestereo.diagnose.refine.light import SCALES
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.diagnose.score.intervals import Interval
from activestereo.effects import Model
from activestereo.effects.core.scene_surfaces import material_of, scene_surfaces
from activestereo.model import SensorModel, diagnosed_model
from activestereo.model.model import NOISE_TERMS, MeasuredPose

_NAMES = ("projector_scale", "ambient_scale", "black_dn")


def found_model(
    evidence: Evidence, model: Model, solution: Solution, found: Mapping[str, Mapping[str, Interval]]
) -> SensorModel:
    """Returns a sensor model: the capture's calibration and pattern, the effects of `model`, the nuisances and albedos
    of its fit, and the noise model if the noise was measured. found: {effect: its parameters with intervals}."""
    geometry, surfaces = standing(evidence, solution), scene_surfaces(evidence.capture.scene_path)
    factors = albedo_factors(evidence, solution)
    albedo = {
        material_of(surfaces[number].name): float(factors[index])
        for index, number in albedo_surfaces(evidence).items()
        if index >= 0 and number < len(surfaces)
    }
    intervals = {
        (id, name): (parameter.low, parameter.high)
        for id, parameters in found.items()
        for name, parameter in parameters.items()
    }
    measured = geometry.capture()
    frames = zip(geometry.stated.frames, measured.frames, strict=True)
    poses = {s.camera_to_world.tobytes(): (s.camera_to_world, f.camera_to_world) for s, f in frames}
    is_noise_known = evidence.has_floor and evidence.capture.binning == 1
    return diagnosed_model(
        unbinned(measured),
        model,
        nuisances=dict(zip(_NAMES, map(float, solution.phi[:SCALES]), strict=True)),
        noise={name: getattr(evidence.noise_model, name) for name in NOISE_TERMS} if is_noise_known else None,
        albedo=albedo,
        intervals=intervals,
        material_names=[surface.name for surface in surfaces],
        poses=[MeasuredPose(stated, there) for stated, there in poses.values() if (stated != there).any()],
    )
