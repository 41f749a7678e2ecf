# SPDX-License-Identifier: Apache-2.0
"""Images that the models of a report expect of each frame: the base model, the model with what was found, and each row
of the ranking."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.capture.capture import SIDES
from activestereo.compare.fit_model import predict_under_model
from activestereo.compare.model_file import library
from activestereo.effects import Model, Randomness, Stage, View

if TYPE_CHECKING:
    from activestereo.compare.compare import Comparison
    from activestereo.effects.core.descriptor import Effect

# Rows of the ranking that are shown.
ROWS = 12
BASE, FOUND = "base", "found"
ModelImages = dict[str, dict[tuple[int, str], np.ndarray]]  # {name: {(frame id, side): expected DN}}


def model_images(
    comparison: Comparison,
    diagnosis: dict[str, Any] | None = None,
    effects: Mapping[str, Effect] | None = None,
    progress: Callable[[float], object] | None = None,
    found_images: Mapping[tuple[int, str], np.ndarray] | None = None,
) -> ModelImages:
    """{name: {(frame id, side): expected DN, float32 [height][width]}} under BASE, FOUND and the ids of ranked effects.

    BASE is the model without effects. FOUND is the comparison's model where it has effects, else the diagnosis's; it is
    absent where neither has. A ranked effect stands alone on the base model with its fitted parameters; it is absent
    where it has no expected image of its own: random effects, faults of the depth engine, effects that are not in
    `effects`. Projector scale, ambient scale and black level are fitted to the train frames under each. diagnosis:
    diagnose.json's contents; effects: {id: Effect}, None for the built-in ones. progress: called as progress(fraction
    done). found_images: what the diagnosis itself expects under FOUND; the comparison is then of the model that it
    started from, which stands in the place of the model without effects.
    """
    effects = library() if effects is None else effects
    start = Model() if found_images is None else comparison.model
    models = {BASE: start}
    given = {}
    if found_images is not None and diagnosis and diagnosis["added"]:
        models[FOUND], given[FOUND] = start, dict(found_images)
    elif found_images is None:
        found = comparison.model if comparison.model.effects else _found(diagnosis, effects)
        if found.effects:
            models[FOUND] = found
    for entry in (diagnosis or {}).get("ranking", [])[:ROWS]:
        model = _with(
            start,
            effects,
            entry["effect"],
            {name: parameter["value"] for name, parameter in entry["parameters"].items()},
        )
        if any(_moves_images(effect) for effect, _ in model.effects if effect.id == entry["effect"]):
            models[entry["effect"]] = model
    return _predicted(comparison, models, given, progress)


def _predicted(comparison: Comparison, models: Any, given: Any, progress: Callable[[float], object] | None) -> Any:
    """given: {name: images} of models whose images are there."""
    capture = comparison.capture
    keys = [(frame, side) for frame in capture.frames for side in SIDES]
    views = {(f.id, side): View.of(capture, f, side, comparison.layers[f.id][side]) for f, side in keys}
    measured = comparison.measured
    out = {}
    for done, (name, model) in enumerate(models.items()):
        same = given.get(name) or (comparison.predictions if model == comparison.model else None)
        if same is None:
            expected = predict_under_model(capture, model, (comparison.layers,), views, measured)[1]
            same = {key: images[0].astype(np.float32) for key, images in expected.items()}
        out[name] = same
        if progress:
            progress((done + 1) / len(models))
    return out


def _found(diagnosis: dict[str, Any] | None, effects: Mapping[str, Effect]) -> Any:
    """The diagnosis's model."""
    model = Model()
    for entry in (diagnosis or {}).get("model", {}).get("effects", []):
        model = _with(model, effects, entry["id"], entry.get("parameters", {}))
    return model


def _with(model: Model, effects: Mapping[str, Effect], effect_id: str, parameters: Any) -> Any:
    """The model with an effect; as it is where the effect is not known or does not take these parameters: a report
    shows what it can."""
    try:
        return model.with_effect(effects[effect_id], **parameters)
    except (KeyError, TypeError, ValueError):
        return model


def _moves_images(effect: Effect) -> bool:
    return effect.stage <= Stage.DIGITAL and effect.randomness is Randomness.NONE
