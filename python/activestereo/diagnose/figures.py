# SPDX-License-Identifier: Apache-2.0
"""Computes the held-out errors of the given model and of the written one. If a capture keeps no test frames, each train
frame is left out in turn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Capture
from activestereo.common.computed_once import computed_once
from activestereo.common.progress_bar import Progress
from activestereo.compare.cache import LayerCache
from activestereo.compare.image_errors import BaseLight, ImageErrors, image_errors
from activestereo.compare.render import Halves
from activestereo.diagnose.fitter import Fitter, Solution
from activestereo.diagnose.linear import linearised
from activestereo.effects import Model
from activestereo.effects.core.surfaces import surface_names
from activestereo.model import SensorModel
from activestereo.model.diagnosed import calibrated

if TYPE_CHECKING:
    from activestereo.effects.engines import CaptureRenderer


@dataclass(frozen=True)
class ErrorsOfModels:
    """Computes the ImageErrors of models on a capture, at the stated geometry and at the one that the diagnosis found.
    base: renders the base model's light on all frames of a capture. seed, engines: as in compare(). progress: called
    with the fraction of a model that engines have rendered. cache: keeps their light, or None. stands: the capture at
    the geometry that was found, None if it is as stated."""

    capture: Capture
    base: Callable[[Capture], Halves]
    seed: int = 0
    engines: Callable[[Capture], CaptureRenderer] | None = None
    progress: Progress | None = None
    cache: LayerCache | None = None
    stands: Capture | None = None

    def at_stated_geometry(self, model: SensorModel) -> ErrorsOfModels:
        """Returns the same with the geometry that a model states."""
        there = calibrated(self.capture, model)
        return self if _stand_alike(there, self.capture) else replace(self, stands=there)

    def given(self, model: Model | SensorModel | None) -> ImageErrors:
        """Returns the errors of the model that a diagnosis starts from; None: of the base model. Models of effects are
        on the capture as stated, a SensorModel on the capture that it calibrates."""
        if model is None and self.stands is None:
            return self.plain()
        return self._under(model, calibrated(self.capture, model) if isinstance(model, SensorModel) else self.capture)

    @computed_once
    def plain(self) -> ImageErrors:
        """Returns the errors of the base model on the capture at the geometry that was found."""
        return self._under(None, self.stands or self.capture)

    def found(self, model: Model | SensorModel | None) -> ImageErrors:
        """Returns the errors of a model on the capture at the geometry that was found."""
        return self.plain() if model is None else self._under(model, self.stands or self.capture)

    def _under(self, model: Model | SensorModel | None, capture: Capture) -> ImageErrors:
        is_here = capture is (self.stands or self.capture)
        base = self._base_light() if is_here else BaseLight.of(capture, self.base(capture), self.seed)
        measured, engines = None, None if model is None else self.engines
        if isinstance(model, SensorModel):
            names = surface_names(capture.scene_path)
            measured = model.scene_measurement(names)
            model = model.bound(names)
        return image_errors(capture, model or Model(), base, engines, measured, self.progress, self.cache)

    @computed_once
    def _base_light(self) -> BaseLight:
        """Returns the base model's light at the geometry that was found. It is kept because it is expensive."""
        capture = self.stands or self.capture
        return BaseLight.of(capture, self.base(capture), self.seed)


def _stand_alike(a: Capture, b: Capture) -> bool:
    """Returns whether cameras, projector and views of two captures are the same."""

    def places(capture: Capture) -> list[NDArray[np.float64]]:
        rig = capture.rig
        cameras = [x for side in SIDES for x in (rig.camera(side).K, rig.camera(side).distortion)]
        projector = rig.projector.K, rig.projector.left_to_projector
        return [*cameras, rig.left_to_right, *projector, *(frame.camera_to_world for frame in capture.frames)]

    return all(map(np.array_equal, places(a), places(b)))


def held_out_figures(
    errors: ErrorsOfModels, given: Model | SensorModel | None, added: list[str], written: SensorModel
) -> tuple[dict[str, Any], ImageErrors, ImageErrors, ImageErrors]:
    """Returns (errors in numbers, ImageErrors of the given model, of the same at the geometry that was found, of the
    written model).

    Numbers are root mean squares in DN pooled over images, without the renderer's noise (noise_square); None without
    test frames. errors: with the geometry of the written model, which model.json holds. added: the effects that the
    written model has more.
    """
    before, after = errors.given(given), errors.found(written)
    standing = before if errors.stands is None else errors.found(given)
    floors = {split: e["noise_floor_dn"] for split, e in after.by_split().items()}

    def rmse(errors: ImageErrors, split: str) -> float | None:
        return errors.by_split().get(split, {}).get("rmse_dn")

    figures: dict[str, Any] = {
        "heldout_ir_rmse_before": rmse(before, "test"),
        "heldout_ir_rmse_geometry": rmse(standing, "test"),
        "heldout_ir_rmse_after": rmse(after, "test"),
        "heldout_noise_floor": floors.get("test"),
        "train_noise_floor": floors.get("train"),
        "curve": [
            {"effects": names, "train_ir_rmse": rmse(e, "train"), "heldout_ir_rmse": rmse(e, "test")}
            for names, e in (([], before), (added, after))[: 1 + bool(added)]
        ],
    }
    return figures, before, standing, after


def left_out_rmse(fitter: Fitter, solution: Solution) -> float:
    """Returns the root mean square error in DN of each frame under parameters and nuisances fitted to all other frames,
    by the linear model at a solution. Pixels where the scene is unknown do not count."""
    linear, weight = linearised(fitter, solution), np.concatenate([p.root_weight for p in fitter.pixels()])
    frame = np.concatenate([np.full(len(p.index), p.observation.frame.id) for p in fitter.pixels()])
    A, r = linear.nuisances, linear.residual
    gram, moment = (A @ A.T).astype(np.float64) + np.diag(linear.precision), (A @ r).astype(np.float64) - linear.pull
    squares = count = 0.0
    for number in np.unique(frame):
        here = np.flatnonzero((frame == number) & (weight > 0.0))
        own, rest = A[:, here], r[here]
        kept, norm = gram - own @ own.T, np.sqrt(np.maximum(np.diag(gram), 1e-300))
        step = np.linalg.lstsq(kept / np.outer(norm, norm), (moment - own @ rest) / norm, rcond=1e-9)[0] / norm
        squares += float((((rest - step @ own) / weight[here]) ** 2).sum())
        count += here.size
    return float(np.sqrt(squares / max(count, 1.0)))
