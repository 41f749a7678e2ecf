# SPDX-License-Identifier: Apache-2.0
"""Computes held-out errors of the given model and of the found model. If a capture has no test frames, each train frame
is left out in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Capture
from activestereo.common.progress_bar import Progress, part_of
from activestereo.compare.image_errors import ImageErrors, Judged, image_errors
from activestereo.compare.mismatch import recording_warnings
from activestereo.compare.render import BaseRenders
from activestereo.diagnose.fitter import Fitter, Solution
from activestereo.diagnose.linear import linearised
from activestereo.effects import Model
from activestereo.effects.core.surfaces import surface_names
from activestereo.effects.engines import CaptureRenderer
from activestereo.model import SensorModel
from activestereo.model.diagnosed import calibrated

_GIVEN_SHARE = 0.4  # of the progress, for a given model at the stated geometry
# Entries of diagnose.json where nothing is known of them.
NOTHING_TOLD: dict[str, Any] = {
    **dict.fromkeys(("heldout_ir_rmse_before", "heldout_ir_rmse_geometry", "heldout_ir_rmse_after")),
    **dict.fromkeys(("heldout_noise_floor", "depth_split", "residual_model")),
    "curve": [],
    "geometry": [],
    "albedos": [],
}


@dataclass(frozen=True)
class ErrorsOfModels:
    """Computes ImageErrors of models on a capture, at its stated geometry and at the estimated geometry. renders: of
    the base model's light (image_errors()). engines: as in compare(). progress: called with the share done. stands: the
    capture at the estimated geometry, None if that is the stated one."""

    capture: Capture
    renders: BaseRenders
    engines: Callable[[Capture], CaptureRenderer] | None = None
    progress: Progress | None = None
    stands: Capture | None = None

    def at_stated_geometry(self, model: SensorModel) -> ErrorsOfModels:
        """Returns these ErrorsOfModels with the geometry that a model states as the estimated one."""
        there = calibrated(self.capture, model)
        return self if _stand_alike(there, self.capture) else replace(self, stands=there)

    def under(
        self, capture: Capture, models: Sequence[Model | SensorModel | None], first: float, last: float
    ) -> list[ImageErrors]:
        """Returns the errors of models on a capture; None = the base model. first, last: shares of the progress."""
        names, judged = surface_names(capture.scene_path), []
        for model in models:
            if isinstance(model, SensorModel):
                judged.append(Judged(model.bound(names), self.engines, model.scene_measurement(names)))
            else:
                judged.append(Judged(Model()) if model is None else Judged(model, self.engines))
        return image_errors(capture, judged, self.renders, part_of(self.progress, first, last))


def _stand_alike(a: Capture, b: Capture) -> bool:
    """Returns whether two captures have the same cameras, projector and poses."""

    def places(capture: Capture) -> list[NDArray[np.float64]]:
        rig = capture.rig
        cameras = [x for side in SIDES for x in (rig.camera(side).K, rig.camera(side).distortion)]
        projector = rig.projector.K, rig.projector.left_to_projector
        return [*cameras, rig.left_to_right, *projector, *(frame.camera_to_world for frame in capture.frames)]

    return all(map(np.array_equal, places(a), places(b)))


@dataclass(frozen=True)
class HeldOut:
    """Errors of the given model (before), of the given model and of the base model at the estimated geometry (standing,
    plain), and of the written model (after)."""

    before: ImageErrors
    standing: ImageErrors
    plain: ImageErrors
    after: ImageErrors


def held_out_figures(
    errors: ErrorsOfModels, given: Model | SensorModel | None, added: list[str], written: SensorModel
) -> tuple[dict[str, Any], HeldOut]:
    """Returns (errors as numbers, the same as images).

    Numbers are root mean squares in DN over all images of a split, without the renderer's noise; None if the split has
    no frames. errors: with the geometry of the written model. written: the contents of model.json. added: the effects
    that it has beyond the given model.
    """
    before, done = None, 0.0
    if errors.stands is not None or isinstance(given, SensorModel):
        # A Model is judged at the capture's stated geometry, a SensorModel at its own calibration.
        own = calibrated(errors.capture, given) if isinstance(given, SensorModel) else errors.capture
        [before], done = errors.under(own, [given], 0.0, _GIVEN_SHARE), _GIVEN_SHARE
    models = [written, given, None][: 2 + (given is not None)]
    after, standing, *plain = errors.under(errors.stands or errors.capture, models, done, 1.0)
    before = before or standing
    floors = {split: e["noise_floor_dn"] for split, e in after.by_split().items()}

    def rmse(errors: ImageErrors, split: str) -> float | None:
        return errors.by_split().get(split, {}).get("rmse_dn")

    figures: dict[str, Any] = {
        "warnings": recording_warnings(before),
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
    return figures, HeldOut(before, standing, plain[0] if plain else standing, after)


def without_light(
    before: ImageErrors | None, after: ImageErrors | None
) -> tuple[ImageErrors | None, ImageErrors | None]:
    """Returns the errors of a given and of a found model without light that nothing reads any more, gigabytes of large
    images. The first keeps what a comparison reads, the second its images."""
    if before is not None:
        before.forget()
    return before, None if after is None else replace(after, layers={}, views={})


def left_out_rmse(fitter: Fitter, solution: Solution) -> float:
    """Returns the root mean square error in DN if each frame is predicted by a fit to all other frames. That fit is the
    linear model at the solution. Pixels where the scene is unknown do not count."""
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
