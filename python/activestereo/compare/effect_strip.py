# SPDX-License-Identifier: Apache-2.0
"""One picture of a small world without an effect, and with it at typical values."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from activestereo.compare.nuisances import Nuisances
from activestereo.compare.render import WARP_SCALE, render_frames
from activestereo.compare.surrogate import trial_capture
from activestereo.effects.core.descriptor import Effect, Stage
from activestereo.effects.core.model import Model
from activestereo.effects.core.surfaces import SURFACES
from activestereo.effects.core.view import View

if TYPE_CHECKING:
    from activestereo.compare.cache import LayerCache
    from activestereo.compare.layers import Layers
    from activestereo.compare.render import Renderer

# Effects that act between the cameras move the right image.
_SIDE = "right"
_SCALE = 2.0
_SAMPLES, _BOUNCES = 128, 2
_STRENGTHS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
_NUISANCES = Nuisances(projector_scale=120000.0, ambient_scale=9000.0, black_dn=5.0)


@dataclass(frozen=True)
class EffectStrip:
    """One picture without an effect and with it, [height][width], in unit; nothing where neither is positive."""

    effect: Effect
    parameters: dict[str, float]
    unit: str
    without: NDArray[np.float64]
    with_it: NDArray[np.float64]

    @property
    def difference(self) -> NDArray[np.float64]:
        return self.with_it - self.without


class StripWorld:
    """The small world of compare/surrogate.py, rendered once: a warm rig that moves over bodies on a table."""

    def __init__(self, renderer: Renderer, cache: LayerCache | None = None) -> None:
        with tempfile.TemporaryDirectory() as folder:
            capture = trial_capture(Path(folder), _SCALE)
            frame = capture.frames[0]
            layers = render_frames(capture, renderer, _SAMPLES, _BOUNCES, cache=cache, scale=WARP_SCALE)[frame.id]
            self._views = {side: View.of(capture, frame, side, layers[side]) for side in layers}
            self._layers: Mapping[str, Layers] = layers
            self._focal_baseline = float(capture.rig.left.K[0, 0] * capture.rig.baseline_m)

    def strip(self, effect: Effect, given: Mapping[str, float] | None = None) -> EffectStrip:
        """An EffectStrip. given: parameters that are not to be typical."""
        values = effect.typical_values | ({SURFACES.name: 0.0} if SURFACES in effect.parameters else {})
        values = effect.values(values | dict(given or {}))
        if effect.stage > Stage.DIGITAL:
            return self._of_depth(effect, values)
        images = [self._image(model) for model in (Model(), Model().with_effect(effect, **values))]
        return EffectStrip(effect, values, "DN", *images)

    def strengths(self, effect: Effect) -> list[EffectStrip]:
        """EffectStrips from no effect over the typical values to twice their distance from neutral; what says where or
        how stays."""
        moved = [p for p in effect.parameters if not p.choice]
        strips = []
        for share in _STRENGTHS:
            far = {p.name: p.neutral + share * (p.typical_value - p.neutral) for p in moved}
            strips.append(self.strip(effect, {p.name: min(max(far[p.name], p.low), p.high) for p in moved}))
        return strips

    def _image(self, model: Model) -> NDArray[np.float64]:
        view = self._views[_SIDE]
        light = model.light(self._layers[_SIDE], view, True)
        return np.asarray(model.signal(light, view, _NUISANCES, True), dtype=np.float64)

    def _of_depth(self, effect: Effect, values: dict[str, float]) -> EffectStrip:
        """The depth engine's effects act on the disparity of the geometry, or on its depth."""
        view = self._views["left"]
        depth = np.where(np.isfinite(view.depth_m), view.depth_m, 0.0).astype(np.float64)
        disparity = np.where(depth > 0.0, self._focal_baseline / np.maximum(depth, 1e-6), 0.0)
        value, unit = (disparity, "px") if effect.stage is Stage.DISPARITY else (depth, "m")
        changed = np.asarray(effect.apply(value.copy(), view, **values), dtype=np.float64)
        return EffectStrip(effect, values, unit, value, changed)
