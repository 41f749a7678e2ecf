# SPDX-License-Identifier: Apache-2.0
"""A model: the base renderer plus effects with their parameters, from light layers to what the sensor gives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from activestereo.effects.core.descriptor import Effect, Randomness, Stage
from activestereo.effects.core.light import Light, Rendered
from activestereo.effects.core.view import View

if TYPE_CHECKING:
    from activestereo.capture.capture import Frame


class Scales(Protocol):
    """Factors on the projector's and the ambient light, and the black level in DN: compare.nuisances.Nuisances, for
    one."""

    @property
    def projector_scale(self) -> float: ...

    @property
    def ambient_scale(self) -> float: ...

    @property
    def black_dn(self) -> float: ...


class SeenLight(Protocol):
    """The light that falls on an imager: a Light, for one."""

    @property
    def projector(self) -> np.ndarray: ...

    @property
    def ambient(self) -> np.ndarray: ...


@dataclass(frozen=True)
class Model:
    """effects: pairs (Effect, {parameter: value}); applied in stage order, within a stage in the order given."""

    effects: tuple[tuple[Effect, dict[str, float]], ...] = ()

    def with_effect(self, effect: Effect, **parameters: float) -> Model:
        """A model with one effect more, or with other parameters of one that it has."""
        kept = tuple((e, p) for e, p in self.effects if e.id != effect.id)
        return Model((*kept, (effect, effect.values(parameters))))

    def without_effect(self, effect_id: str) -> Model:
        return Model(tuple((e, p) for e, p in self.effects if e.id != effect_id))

    def light(self, layers: Rendered, view: View, random: bool = False, supersampled: bool = True) -> Light:
        """The Light that falls on the sensor, from rendered layers. supersampled=False: warps look up the pixels even
        where the layers have supersampled images: less than half the time, for scans."""
        light = Light.of(layers) if supersampled else replace(Light.of(layers), supersampled=None)
        for effect, parameters in self.on_light(random):
            light = acted(effect, parameters, light, view)
        return light

    def on_light(self, random: bool = False) -> tuple[tuple[Effect, dict[str, float]], ...]:
        """Pairs (Effect, {parameter: value}) up to the lens, in the order of the pipeline."""
        return self._of(Stage.PROJECTOR, Stage.OPTICS, random)

    def outside_engines(self) -> Model:
        """The effects that no engine field expresses."""
        return Model(tuple((e, p) for e, p in self.effects if e.engine is None))

    @property
    def is_linear(self) -> bool:
        """Whether nothing acts between the lens and the digital numbers: without random effects, signal() is linear but
        for clipping."""
        return not self._of(Stage.CHARGE, Stage.DIGITAL, False)

    def signal(self, light: SeenLight, view: View, nuisances: Scales, random: bool = False) -> np.ndarray:
        """DN of a Light, black level included. random=False: the expected value, without rounding; zero-mean noise is
        left out and random fields are drawn as their mean. random=True: one exposure."""
        projector, ambient = scales(view.frame)
        value = (
            nuisances.projector_scale * projector * light.projector + nuisances.ambient_scale * ambient * light.ambient
        )
        return self.digital(value, view, nuisances.black_dn, random)

    def digital(self, value: np.ndarray, view: View, black_dn: float, random: bool = False) -> np.ndarray:
        """signal() of DN above black [height][width] that an ideal sensor would count."""
        for effect, parameters in self._of(Stage.CHARGE, Stage.READOUT, random):
            value = effect.apply(value, view, **effect.on_pixels(parameters, view.binning))
        value = value + black_dn
        for effect, parameters in self._of(Stage.DIGITAL, Stage.DIGITAL, random):
            value = effect.apply(value, view, **effect.on_pixels(parameters, view.binning))
        return np.minimum(np.maximum(value, 0.0), view.max_dn)

    def depth(self, depth_m: np.ndarray, view: View, stream: dict[str, np.ndarray] | None = None) -> np.ndarray:
        """A matched depth image (left camera, metres, 0 = none) as the device gives it. view: the left camera's.

        stream: {effect: what it gave for the frame before} of effects that remember, changed to this frame's; None:
        the first frame of one.
        """
        stream = {} if stream is None else stream
        matched = np.asarray(depth_m, dtype=np.float64)
        if self._of(Stage.DISPARITY, Stage.DISPARITY, True):
            disparity = inverse_depth(matched, view)
            for effect, parameters in self._of(Stage.DISPARITY, Stage.DISPARITY, True):
                disparity = _in_stream(effect, parameters, disparity, view, stream)
            matched = inverse_depth(disparity, view)
        for effect, parameters in self._of(Stage.DEPTH, Stage.DEPTH, True):
            matched = _in_stream(effect, parameters, matched, view, stream)
        return matched

    @property
    def remembers(self) -> bool:
        """Whether an effect on disparity or depth follows a stream of frames."""
        return any(effect.remembers for effect, _ in self.effects)

    def _of(self, first: Stage, last: Stage, random: bool) -> tuple[tuple[Effect, dict[str, float]], ...]:
        chosen = [(e, p) for e, p in self.effects if first <= e.stage <= last]
        if not random:
            chosen = [(e, p) for e, p in chosen if e.randomness is Randomness.NONE]
        return tuple(sorted(chosen, key=lambda pair: pair[0].stage))


def _in_stream(
    effect: Effect, parameters: dict[str, float], image: np.ndarray, view: View, stream: dict[str, np.ndarray]
) -> np.ndarray:
    """A disparity or depth image after an effect that may remember the frame before."""
    if not effect.remembers:
        return effect.apply(image, view, **parameters)
    stream[effect.id] = effect.apply(image, replace(view, before=stream.get(effect.id)), **parameters)
    return stream[effect.id]


def acted(effect: Effect, parameters: dict[str, float], light: Light, view: View) -> Light:
    """A Light after an effect up to the lens."""
    own = effect.on_pixels(parameters, view.binning)
    if effect.stage is Stage.OPTICS:
        return light.map(lambda images: effect.apply(images, view, **own))
    if effect.is_pointwise:
        return light.pointwise(lambda some, there: effect.apply(some, there, **own), view)
    return effect.apply(light, view, **own)


def scales(frame: Frame) -> tuple[float, float]:
    """The factors of projector light and of ambient light by a frame's settings: seconds x gain x level."""
    level = 1.0 if frame.ambient is None else frame.ambient
    return frame.exposure_gain * frame.projector_power, frame.exposure_gain * level


def inverse_depth(image: np.ndarray, view: View) -> np.ndarray:
    """Disparity in px of depth in m, or depth of disparity; 0 stays 0. view: the left camera's."""
    return np.where(image > 0, view.K[0, 0] * view.baseline_m / np.where(image > 0, image, 1.0), 0.0)
