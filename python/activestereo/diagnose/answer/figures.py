# SPDX-License-Identifier: Apache-2.0
"""Held-out figures of a diagnosis: those that `compare` tells of the given model, and of the model that is written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from activestereo.capture.capture import Capture
from activestereo.common.computed_once import computed_once
from activestereo.common.progress_bar import Progress
from activestereo.compare.cache import LayerCache
from activestereo.compare.image_errors import ImageErrors, image_errors
from activestereo.compare.render import Halves
from activestereo.effects import Model
from activestereo.effects.core.scene_surfaces import surface_names
from activestereo.model import SensorModel
from activestereo.model.calibrated import calibrated

if TYPE_CHECKING:
    from activestereo.effects.engines import CaptureRenderer

Step: TypeAlias = tuple[Sequence[str], SensorModel]  # effects added, and the model with them


@dataclass(frozen=True)
class ErrorsOfModels:
    """The ImageErrors of models on a capture, as it is stated, and on what was measured of it. base: renders the base
    model's light on all frames of a capture; seed and engines as of compare(). progress: called with the fraction of a
    model that engines have rendered. cache: where their light is kept, or None."""

    capture: Capture
    measured: Capture
    base: Callable[[Capture], Halves]
    seed: int = 0
    engines: Callable[[Capture], CaptureRenderer] | None = None
    progress: Progress | None = None
    cache: LayerCache | None = None

    def given(self, model: Model | SensorModel | None, measured: bool = False) -> ImageErrors:
        """Errors of the model that a diagnosis starts from, on the capture as stated or as measured. None: there is
        none; the base model's light is taken."""
        own = self.measured if measured else self.capture
        if isinstance(model, SensorModel):
            capture = calibrated(own, model)
            return self._under(model, capture, self.base(capture))
        if model is None and own is self.measured:
            return self.plain()
        engines = None if model is None else self.engines
        base = self._measured_base() if measured else self._own_base()
        return image_errors(own, model or Model(), base, self.seed, engines, None, self.progress, self.cache)

    @computed_once
    def plain(self) -> ImageErrors:
        """Errors of the base model on the capture as measured."""
        return image_errors(self.measured, Model(), self._measured_base(), self.seed, progress=self.progress)

    def found(self, model: SensorModel) -> ImageErrors:
        """Errors of a model with the calibration, pattern and poses that it was found with."""
        capture = calibrated(self.capture, model)
        return self._under(model, capture, self.base(capture))

    def _under(self, model: SensorModel, capture: Capture, base: Halves) -> ImageErrors:
        names = surface_names(capture.scene_path)
        bound, scene_measurement = model.bound(names), model.scene_measurement(names)
        engines, progress, cache = self.engines, self.progress, self.cache
        return image_errors(capture, bound, base, self.seed, engines, scene_measurement, progress, cache)

    @computed_once
    def _own_base(self) -> Halves:
        return self.base(self.capture)

    @computed_once
    def _measured_base(self) -> Halves:
        return self._own_base() if self.measured is self.capture else self.base(self.measured)


def held_out_figures(
    errors: ErrorsOfModels, given: Model | SensorModel | None, between: Sequence[Step], written: Step
) -> tuple[dict[str, Any], ImageErrors, ImageErrors, ImageErrors]:
    """(figures pooled over images, DN, without the renderer's own noise (render_noise.py), None without test frames;
    the errors of the given model; on the capture as measured; those of the written one).

    between: models on the way from the given one to the written one, which model.json holds.
    """
    added, model = written
    before, after = errors.given(given), errors.found(model)
    way = [((), before), *((names, errors.found(m)) for names, m in between), *([(added, after)] if added else [])]
    is_moved = errors.measured is not errors.capture
    standing = errors.given(given, measured=True) if is_moved else before
    floors = {split: e["noise_floor_dn"] for split, e in after.by_split().items()}
    figures = {
        "heldout_ir_rmse_before": _rmse(before, "test"),
        "heldout_ir_rmse_geometry": _rmse(standing, "test"),
        "heldout_ir_rmse_after": _rmse(after, "test"),
        "heldout_noise_floor": floors.get("test"),
        "train_noise_floor": floors.get("train"),
        "curve": [
            {"effects": list(names), "train_ir_rmse": _rmse(e, "train"), "heldout_ir_rmse": _rmse(e, "test")}
            for names, e in way
        ],
    }
    return figures, before, standing, after


def _rmse(errors: ImageErrors, split: str) -> float | None:
    return errors.by_split().get(split, {}).get("rmse_dn")
