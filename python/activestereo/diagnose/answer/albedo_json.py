# SPDX-License-Identifier: Apache-2.0
"""The albedos in a diagnosis: materials whose reflectance differs from the scene's."""

from typing import Any

import numpy as np

from activestereo.common.input_files import read_json
from activestereo.diagnose.answer.verdict_words import beyond_stated
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.light import DENSE
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.diagnose.score.likelihood import design_effect
from activestereo.effects import Stage
from activestereo.effects.core.scene_surfaces import material_of, scene_surfaces

# A correction is reported if it exceeds so many standard errors and so many stated deviations.
_TOLD_SIGMAS = 3.0


def albedo_surfaces(evidence: Evidence) -> dict[int, int]:
    """Returns {index of an albedo nuisance: the number of a surface of its material}. Index -1 stands for the largest
    material, whose albedo is part of the scales."""
    found: dict[int, int] = {}
    for o in evidence.train:
        for index in np.unique(o.material):
            if int(index) not in found:
                numbers, counts = np.unique(np.asarray(o.layers.material)[o.material == index], return_counts=True)
                found[int(index)] = int(numbers[np.argmax(counts)])
    return found


def albedo_factors(evidence: Evidence, solution: Solution) -> np.ndarray:
    """Returns each albedo nuisance as a factor on the scene's albedo, [n], at least 0: a fit that misses an effect may
    ask for less."""
    return np.maximum(0.0, 1.0 + solution.phi[DENSE : DENSE + evidence.materials])


def albedo_json(evidence: Evidence, fitter: Fitter, solution: Solution) -> list[dict[str, Any]]:
    """Returns [{material, text, factor on the scene's albedo, its standard error, its distance from 1 in stated
    deviations}] of materials far from their stated albedo. It is empty beside an effect of surfaces, which changes the
    meaning of albedos.

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
