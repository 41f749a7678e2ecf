# SPDX-License-Identifier: Apache-2.0
"""The sensor model that a diagnosis returns, and its geometry and albedos that differ from the stated ones."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from activestereo.capture.capture import SIDES, unbinned
from activestereo.common.input_files import read_json
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.fitter import Fitter, Solution
from activestereo.diagnose.geometry import TWIST, Geometry
from activestereo.diagnose.geometry_search import standing
from activestereo.diagnose.goodness import Interval, design_effect
from activestereo.diagnose.pixels import DENSE, SCALES
from activestereo.diagnose.words import beyond_stated
from activestereo.effects import Model, Stage
from activestereo.effects.core.surfaces import material_of, scene_surfaces
from activestereo.model import SensorModel, diagnosed_model
from activestereo.model.model import NOISE_TERMS, MeasuredPose

# A correction is reported if it exceeds so many standard errors; of an albedo, so many stated deviations too.
_TOLD_SIGMAS = 3.0
_NAMES = ("projector_scale", "ambient_scale", "black_dn")


def geometry_json(geometry: Geometry) -> list[dict[str, Any]]:
    """Returns [{what, text, the correction, its standard errors}] for corrections far beyond their standard errors.
    Corrections are relative changes of focal lengths; moves in mm and turns in degrees of projector and views.
    stated_sigmas: the largest correction of one coordinate, in stated deviations."""
    if geometry.is_as_stated():
        return []
    known, told = geometry.stated.uncertainty, list[dict[str, Any]]()
    focal, twists = np.split(geometry.deviations, [len(SIDES)])
    for side, change, deviation in zip(SIDES, geometry.focal, focal, strict=True):
        if abs(change) > _TOLD_SIGMAS * deviation:
            sigmas, which = abs(change) / known.focal, "longer" if change > 0 else "shorter"
            text = f"the {side} camera's focal length is {100 * abs(change):.2f} % {which} than the capture says"
            entry = {"what": f"focal_{side}", "text": text + beyond_stated(sigmas), "relative": float(change)}
            told.append(entry | {"relative_sigma": float(deviation), "stated_sigmas": float(sigmas)})
    moved = np.vstack([geometry.projector, geometry.poses])
    for row, (twist, deviations) in enumerate(zip(moved, twists.reshape(-1, TWIST), strict=True)):
        if not (np.abs(twist) > _TOLD_SIGMAS * deviations).any():
            continue
        frames = geometry.frames_of(row - 1) if row else []
        stated = (known.pose_m, known.pose_rad) if row else (known.projector_m, known.projector_rad)
        sigmas = float(np.abs(twist / np.repeat(stated, TWIST // 2)).max())
        moved_mm, turned_deg = 1e3 * float(np.linalg.norm(twist[:3])), float(np.degrees(np.linalg.norm(twist[3:])))
        name = f"the camera of frame {', '.join(map(str, frames))}" if row else "the projector"
        by = f"{moved_mm:.1f} mm ({turned_deg:.2f} degrees)"
        told.append(
            {
                "what": "view" if row else "projector",
                "text": f"{name} stands {by} from where the capture says{beyond_stated(sigmas)}",
                "frames": frames,
                "moved_mm": moved_mm,
                "turned_deg": turned_deg,
                "twist": twist.tolist(),
                "twist_sigma": deviations.tolist(),
                "stated_sigmas": sigmas,
            }
        )
    return told


def albedo_surfaces(evidence: Evidence) -> dict[int, int]:
    """Returns {index of an albedo nuisance: index of a surface with its material}. Key -1 is the largest material,
    whose albedo is part of the light scales."""
    found: dict[int, int] = {}
    for o in evidence.train:
        for index in np.unique(o.material):
            if int(index) not in found:
                numbers, counts = np.unique(np.asarray(o.layers.material)[o.material == index], return_counts=True)
                found[int(index)] = int(numbers[np.argmax(counts)])
    return found


def albedo_factors(evidence: Evidence, solution: Solution) -> np.ndarray:
    """Returns each fitted albedo divided by the scene's albedo, [n]. Negative values become 0: a fit that misses an
    effect may have them."""
    return np.maximum(0.0, 1.0 + solution.phi[DENSE : DENSE + evidence.materials])


def albedo_json(evidence: Evidence, fitter: Fitter, solution: Solution) -> list[dict[str, Any]]:
    """Returns [{material, text, factor, factor_sigma, stated_sigmas}] for materials far from their stated albedo.
    factor: fitted over stated albedo, with its standard error. stated_sigmas: its distance from 1 in stated deviations.
    The list is empty if an effect of surfaces was fitted, which changes the meaning of albedos.

    Light and albedos share one factor, which is fixed so that the median material reflects as stated.
    """
    if any(effect.stage is Stage.SURFACE for effect in solution.effects):
        return []
    first, materials = len(solution.theta) + DENSE, evidence.materials
    design = design_effect(solution.sums.tile_chi2, fitter.tile_pixels())
    design *= max(1.0, solution.sums.total / evidence.pixels)
    errors = np.sqrt(design * np.diag(fitter.inverse(solution))[first : first + materials])
    factors = {-1: 1.0} | dict(enumerate(albedo_factors(evidence, solution)))
    usual = float(np.median(list(factors.values())))
    surfaces, told = scene_surfaces(evidence.capture.scene_path), []
    for index, number in sorted(albedo_surfaces(evidence).items()):
        factor, error = factors[index] / usual, float(errors[index]) if index >= 0 else 0.0
        stated = evidence.capture.uncertainty.albedo
        least, sigmas = _TOLD_SIGMAS * max(error, stated), abs(factor - 1.0) / stated
        if number < len(surfaces) and abs(factor - 1.0) > least:
            name = material_of(surfaces[number].name)
            albedo = _stated(evidence, surfaces[number].material)
            says = f"{factor:.2f} of what the scene says"
            if albedo is not None:
                says = f"{factor * albedo:.2f}, the scene says {albedo:.2f}"
            text = f"{name} reflects {says}{beyond_stated(sigmas)}"
            entry = {"material": name, "text": text, "factor": factor, "factor_sigma": error}
            told.append(entry | {"stated_sigmas": sigmas})
    return told


def _stated(evidence: Evidence, number: int) -> float | None:
    """Returns the infrared albedo of a material in the scene file; None if it has none, or a texture gives it."""
    if evidence.capture.scene_path.suffix.lower() != ".gltf":
        return None
    materials = read_json(evidence.capture.scene_path).get("materials", [])
    extras = materials[number].get("extras", {}) if number < len(materials) else {}
    return None if "ir_albedo_texture" in extras else extras.get("ir_albedo")


def found_model(
    evidence: Evidence, model: Model, solution: Solution, found: Mapping[str, Mapping[str, Interval]]
) -> SensorModel:
    """Returns the sensor model: the capture's calibration and pattern, the effects of `model`, fitted nuisances and
    albedos, and the noise model if it was measured. found: {effect: {parameter: its interval}}."""
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
    # A block's variance is its pixels' mean one, divided by their number.
    noise = {n: getattr(evidence.noise_model, n) * evidence.capture.binning**2 for n in NOISE_TERMS}
    return diagnosed_model(
        unbinned(measured),
        model,
        nuisances=dict(zip(_NAMES, map(float, solution.phi[:SCALES]), strict=True)),
        noise=noise if evidence.has_floor else None,
        albedo=albedo,
        intervals=intervals,
        material_names=[surface.name for surface in surfaces],
        poses=[MeasuredPose(stated, there) for stated, there in poses.values() if (stated != there).any()],
    )
