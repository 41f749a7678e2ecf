# SPDX-License-Identifier: Apache-2.0
"""Makes the pictures that show an effect: one camera's image, depth or disparity without the effect and with it."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Capture, Frame
from activestereo.compare.cache import LayerCache
from activestereo.compare.depth_compare import SETTLING_FRAMES, DepthModel, expose
from activestereo.compare.effect_trials import BOUNCES, NUISANCES, trial_capture
from activestereo.compare.noise import NoiseModel
from activestereo.compare.render import WARP_SCALE, Renderer, render_frames
from activestereo.effects.core.descriptor import Effect, Stage
from activestereo.effects.core.model import Model, Nuisances, inverse_depth
from activestereo.effects.core.surfaces import SURFACES
from activestereo.effects.core.view import Layers, View, random_stream

# The pictures show the right camera, because effects on the camera geometry move its image.
_SIDE = "right"
_SCALE = 2.0
_STRIP_SAMPLES = 128
_STRENGTHS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
# Three times as much light as NUISANCES, in which the dots saturate.
_BRIGHT = Nuisances(projector_scale=360000.0, ambient_scale=27000.0, black_dn=5.0)
# An effect that changes fewer pixels than this share cannot be seen.
_LEAST_CHANGED = 1e-3
# Noise of the pairs that are matched; relative 0.01 is a speckle contrast of a tenth.
_NOISE = NoiseModel(offset=1.0, shot=0.02, relative=0.01, black_dn=5.0)


@dataclass(frozen=True)
class EffectStrip:
    """Holds a pair of pictures [height][width], without an effect and with it (with_it), to show the effect. unit of
    both: "DN", "m" of depth or "px" of disparity (0 = none). parameters: the effect's values."""

    effect: Effect
    parameters: dict[str, float]
    unit: str
    without: NDArray[np.float64]
    with_it: NDArray[np.float64]

    @property
    def difference(self) -> NDArray[np.float64]:
        return self.with_it - self.without

    @property
    def stays(self) -> NDArray[np.bool_]:
        """Returns which pixels have a value in both pictures: all of "DN". A pixel that gains or loses its depth
        changes by its whole depth, which is no change of size."""
        return np.full(self.without.shape, self.unit == "DN") | ((self.without > 0) & (self.with_it > 0))

    def rms(self) -> float:
        """Returns the root mean square change of the pixels that stay; 0 if there are none."""
        changes = self.difference[self.stays]
        return float(np.sqrt(np.sum(changes**2) / max(1, changes.size)))

    def filled_and_lost(self) -> tuple[int, int]:
        """Returns how many pixels gain a depth, and how many lose theirs."""
        rows = (self.without, self.with_it), (self.with_it, self.without)
        first, second = (np.count_nonzero(~self.stays & (before <= 0) & (after > 0)) for before, after in rows)
        return first, second


class StripView:
    """Makes EffectStrips of one frame from its rendered layers {side: Layers}. base: a Model whose effects act in both
    pictures; None: none. side: the camera that is shown."""

    def __init__(
        self, capture: Capture, frame: Frame, layers: Mapping[str, Layers], nuisances: Nuisances, side: str = _SIDE,
        base: Model | None = None,
    ) -> None:  # fmt: skip
        self._views = {name: View.of(capture, frame, name, layers[name]) for name in layers}
        self._layers, self._nuisances, self._side = layers, nuisances, side
        self._base = Model() if base is None else base
        self._capture, self._frame = capture, frame
        self._matched: list[NDArray[np.float64]] = []

    def strip(self, effect: Effect, given: Mapping[str, float] | None = None) -> EffectStrip:
        """Computes the pictures without and with the effect. given: {parameter: value} that replace the effect's
        typical values."""
        values = effect.typical_values | ({SURFACES.name: 0.0} if SURFACES in effect.parameters else {})
        values = effect.values(values | dict(given or {}))
        if effect.stage > Stage.DIGITAL:
            return self._depth_strip(effect, values)
        models = self._base, self._base.with_effect(effect, **values)
        images = [self._image(model, self._side) for model in models]
        return EffectStrip(effect, values, "DN", *images)

    def strengths(self, effect: Effect, given: Mapping[str, float] | None = None) -> list[EffectStrip]:
        """Returns EffectStrips at nine strengths: 0 is neutral, 1 the `given` (else typical) values, 2 twice as far
        from neutral, within the range. Parameters that are choices keep their values."""
        values = effect.typical_values | dict(given or {})
        moved = [p for p in effect.parameters if not p.choice and p.name != SURFACES.name]
        strips = []
        for share in _STRENGTHS:
            far = {p.name: p.neutral + share * (values[p.name] - p.neutral) for p in moved}
            own = {p.name: min(max(far[p.name], p.low), p.high) for p in moved}
            strips.append(self.strip(effect, dict(given or {}) | own))
        return strips

    def _image(self, model: Model, side: str) -> NDArray[np.float64]:
        view = self._views[side]
        light = model.light(self._layers[side], view, True)
        return np.asarray(model.signal(light, view, self._nuisances, True), dtype=np.float64)

    def _depth_strip(self, effect: Effect, values: dict[str, float]) -> EffectStrip:
        """Computes both pictures for an effect on disparity or depth. It acts on the true depth. If its typical values
        do not change that, it acts on simsense's depth of noisy pairs. It then runs over enough frames for its memory
        to settle."""
        view, stream = self._views["left"], dict[str, np.ndarray]()
        frames = [np.where(np.isfinite(view.depth_m), view.depth_m, 0.0).astype(np.float64)]
        if np.allclose(Model().with_effect(effect, **effect.typical_values).depth(frames[0], view), frames[0]):
            frames, count = self._matched, SETTLING_FRAMES if effect.remembers else 1
            if len(frames) < count:
                engine, images = DepthModel(self._capture), [self._image(self._base, side) for side in SIDES]
                for draw in range(len(frames), count):
                    rng, most = random_stream(draw, "strip"), self._capture.rig.max_dn
                    pair = [expose(image, self._frame.gain, _NOISE, most, rng) for image in images]
                    frames.append(engine.depth(*pair).astype(np.float64))
            frames = frames[:count]
        model = Model().with_effect(effect, **values)
        for depth in frames:
            changed = model.depth(depth, view, stream)
        if effect.stage is Stage.DEPTH:
            return EffectStrip(effect, values, "m", frames[-1], changed)
        return EffectStrip(effect, values, "px", *(inverse_depth(d, view) for d in (frames[-1], changed)))


class StripWorld(StripView):
    """A StripView of the small test world, rendered once. If an effect is invisible in its light, a strip shows it in
    brighter light."""

    def __init__(self, renderer: Renderer, cache: LayerCache | None = None) -> None:
        with tempfile.TemporaryDirectory() as folder:
            capture = trial_capture(Path(folder), _SCALE)
            frame = capture.frames[0]
            layers = render_frames(capture, renderer, _STRIP_SAMPLES, BOUNCES, cache=cache, scale=WARP_SCALE)[frame.id]
            super().__init__(capture, frame, layers, NUISANCES)
            self._bright = StripView(capture, frame, layers, _BRIGHT)

    def strip(self, effect: Effect, given: Mapping[str, float] | None = None) -> EffectStrip:
        shown = super().strip(effect, given)
        if _is_seen(shown) or _is_seen(super().strip(effect)):
            return shown
        return self._bright.strip(effect, given)


def _is_seen(strip: EffectStrip) -> bool:
    return float(np.mean(strip.difference != 0.0)) > _LEAST_CHANGED
