# SPDX-License-Identifier: Apache-2.0
"""Computes the images that models expect: the base model, the model with found effects, and each ranked effect alone.
Also computes residuals and their colour scale."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.processes import forked, return_freed_memory
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.nuisances import fit_with_exposures
from activestereo.diagnose.pixels import LightMemory
from activestereo.effects import Light, Model, Stage, View
from activestereo.model.library import library
from activestereo.report.diagnosis import ROWS

if TYPE_CHECKING:
    from activestereo.capture.capture import ImageKey
    from activestereo.compare.compare import Comparison
    from activestereo.compare.image_errors import ImageErrors
    from activestereo.effects.core.descriptor import Effect

BASE, FOUND = "base", "found"
ModelImages = dict[str, dict[tuple[int, str], np.ndarray]]  # {name: {(frame id, side): expected DN}}
ToldErrors = Mapping[str, Mapping[tuple[int, str], float]]  # {BASE or FOUND: {(frame id, side): RMSE in DN}}
# The colour scale keeps white noise pale, and spans all but a few pixels of the residual.
_NOISE_FLOORS, _SPANNED = 4.0, 0.995


def model_images(
    comparison: Comparison, diagnosis: dict[str, Any] | None = None, effects: Mapping[str, Effect] | None = None,
    progress: Callable[[float], object] | None = None, found_errors: ImageErrors | None = None,
) -> ModelImages:  # fmt: skip
    """Returns the infrared images that models expect: {model: {(frame id, side): DN, float32 [height][width]}}. Models
    are BASE, FOUND and the ids of ranked effects.

    BASE is the model without effects. FOUND is the comparison's model if it has effects, else the diagnosis's; it is
    absent if neither has. A ranked effect is added alone to the base model, with its fitted parameters. Effects without
    an expected image are absent: random effects, faults of the depth engine, effects that are not in `effects`. For
    each model, projector scale, ambient scale and black level are fitted to the train frames.

    diagnosis: diagnose.json's contents. effects: {id: Effect}, None for the built-in ones. progress: called as
    progress(fraction done). found_errors: has the images that the diagnosis itself computed for FOUND; BASE is then the
    model that the diagnosis started from, which is the comparison's."""
    effects = library() if effects is None else effects
    start = Model() if found_errors is None else comparison.model
    models = {BASE: start}
    given = {}
    if found_errors is not None and diagnosis and diagnosis["added"]:
        models[FOUND], given[FOUND] = start, found_errors.predictions
    elif found_errors is None:
        found = comparison.model
        for entry in (diagnosis or {}).get("model", {}).get("effects", []) if not found.effects else ():
            found = _add_effect(found, effects, entry["id"], entry.get("parameters", {}))
        if found.effects:
            models[FOUND] = found
    for entry in (diagnosis or {}).get("ranking", [])[:ROWS]:
        values = {name: parameter["value"] for name, parameter in entry["parameters"].items()}
        model = _add_effect(start, effects, entry["effect"], values)
        own = [effect for effect, _ in model.effects if effect.id == entry["effect"]]
        if any(effect.stage <= Stage.DIGITAL and effect.is_in_mean for effect in own):
            models[entry["effect"]] = model
    return _predicted(comparison, models, given, progress)


def told_errors(comparison: Comparison, found_errors: ImageErrors | None = None) -> ToldErrors:
    """Returns each model's RMSE as the report states it, {BASE or FOUND: {(frame id, side): DN}}. The renderer's noise
    is subtracted from it. found_errors: as in model_images()."""
    is_found = found_errors is None and bool(comparison.model.effects)
    told = {FOUND if is_found else BASE: comparison.scores["frames"]}
    if found_errors is not None:
        told[FOUND] = found_errors.by_frame()
    return {
        name: {(e["id"], side): scores["rmse_dn"] for e in entries for side, scores in e["cameras"].items()}
        for name, entries in told.items()
    }


def _predicted(comparison: Comparison, models: Any, given: Any, progress: Callable[[float], object] | None) -> Any:
    """Computes the images of model_images() in parallel processes. models: {name: Model}. given: {name: images} that
    need no computation."""
    capture, measured = comparison.capture, comparison.measured
    images = [
        MeasuredImage(f, side, View.of(capture, f, side, layers), layers, measured[f.id, side])
        for f in capture.frames
        for side, layers in comparison.layers[f.id].items()
    ]
    views = {image.key: image.view for image in images}
    out = {name: given.get(name) or (comparison.predictions if model == comparison.model else None)
           for name, model in models.items()}  # fmt: skip
    left = [name for name, known in out.items() if known is None]

    def predicted(name: str) -> dict[tuple[int, str], np.ndarray]:
        light = _on_sensor(models[name], images)
        return_freed_memory()
        fit, seen = fit_with_exposures(capture, models[name], light, views, measured)
        expected = {key: models[name].signal(light[key], view, fit.nuisances) for key, view in seen.items()}
        return {key: image.astype(np.float32) for key, image in expected.items()}

    return_freed_memory()
    for i, work in forked(predicted, left, os.cpu_count() or 1):
        out[left[i]] = None if work.exception() else work.result()
        if progress:
            progress(sum(known is not None for known in out.values()) / len(models))
    return {name: predicted(name) if known is None else known for name, known in out.items()}


def _on_sensor(model: Model, images: Sequence[MeasuredImage]) -> dict[ImageKey, Light]:
    """Returns the light of images on the sensor under a model. What effects keep of a pose's images, gigabytes of large
    ones, is dropped before the next pose."""
    at_pose: dict[int, list[MeasuredImage]] = {}
    for image in images:
        at_pose.setdefault(id(image.layers), []).append(image)
    out: dict[ImageKey, Light] = {}
    for alike in at_pose.values():
        light_of = LightMemory(alike)
        for i, image in enumerate(alike):
            own = light_of(model, i)
            nothing = np.broadcast_to(0.0, own.ambient.shape)
            out[image.key] = Light.of_images([own.projector, nothing, own.ambient, nothing])
        for image in alike:
            image.forget()
    return out


def _add_effect(model: Model, effects: Mapping[str, Effect], effect_id: str, parameters: Any) -> Any:
    """Returns the model with an effect added. If the effect or its parameters are unknown it returns the model
    unchanged, so that the report shows the rest."""
    try:
        return model.with_effect(effects[effect_id], **parameters)
    except (KeyError, TypeError, ValueError):
        return model


def known_residual(comparison: Comparison, key: ImageKey, expected: Mapping[ImageKey, NDArray]) -> NDArray[np.float64]:
    """Returns measured minus expected DN [height][width]. It is NaN at pixels where the scene is unknown, which no
    figure of the report counts."""
    capture, residual = comparison.capture, comparison.measured[key].astype(np.float64) - expected[key]
    known = capture.known(next(f for f in capture.frames if f.id == key[0]), key[1])
    return residual if known is None else np.where(known, residual, np.nan)


def rmse(residual: NDArray[np.float64]) -> float:
    """Returns the root mean square of the pixels that are not NaN."""
    return float(np.sqrt(np.nanmean(residual**2)))


def residual_limit(residual: NDArray[np.float64], floor_dn: float | None) -> float:
    """Returns the DN at both ends of a residual's colour scale. floor_dn: the noise floor, or None."""
    spanned = float(np.nanquantile(np.abs(residual), _SPANNED))
    return max(_NOISE_FLOORS * (floor_dn or 0.0), spanned, 1e-3)
