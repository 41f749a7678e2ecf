# SPDX-License-Identifier: Apache-2.0
"""Applies a model (effects with their parameters) to rendered light, up to the digital numbers or the depth that the
sensor gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.effects.core.descriptor import Effect, Stage
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import Layers, View


@dataclass(frozen=True)
class Nuisances:
    """The unknowns of exposure and light. projector_scale, ambient_scale: DN per (second x gain x unit of rendered
    radiance); black_dn: DN without light."""

    projector_scale: float
    ambient_scale: float
    black_dn: float

    def vector(self) -> np.ndarray:
        return np.array([self.projector_scale, self.ambient_scale, self.black_dn])


@dataclass(frozen=True)
class Model:
    """A model of a sensor. effects: pairs (Effect, {parameter: value}), applied by stage, and in the given order within
    a stage."""

    effects: tuple[tuple[Effect, dict[str, float]], ...] = ()

    def __repr__(self) -> str:  # a notebook shows it after Lab.add()
        said = (f"{e.id}({', '.join(f'{n}={v:.4g}' for n, v in values.items())})" for e, values in self.effects)
        return f"Model: {', '.join(said) or 'no effects'}"

    def with_effect(self, effect: Effect, **parameters: float) -> Model:
        """Returns a model with one more effect, or with new parameters of an effect that it has."""
        return Model((*self.without_effect(effect.id).effects, (effect, effect.values(parameters))))

    def without_effect(self, effect_id: str) -> Model:
        return self.only(lambda e, _: e.id != effect_id)

    def only(self, keeps: Callable[[Effect, dict[str, float]], bool]) -> Model:
        """Returns a model of the effects for which keeps(effect, its parameters)."""
        return Model(tuple((e, p) for e, p in self.effects if keeps(e, p)))

    def light(self, layers: Light | Layers, view: View, random: bool = False, supersampled: bool = True) -> Light:
        """Returns the Light that falls on the sensor: rendered layers after all effects up to the lens. random=False
        leaves random effects out. supersampled=False: warps interpolate camera pixels only, in less than half of the
        time, for scans."""
        light = Light.of(layers) if supersampled else replace(Light.of(layers), supersampled=None)
        for effect, parameters in self.on_light(random):
            light = acted(effect, parameters, light, view)
        return light

    def on_light(self, random: bool = False) -> tuple[tuple[Effect, dict[str, float]], ...]:
        """Returns the pairs (Effect, {parameter: value}) that act up to the lens, in the order of the pipeline."""
        return self._select(Stage.PROJECTOR, Stage.OPTICS, random)

    @property
    def is_linear(self) -> bool:
        """Returns whether no effect on expected images acts between the lens and the digital numbers. signal() is
        then linear but for clipping."""
        return not self._select(Stage.CHARGE, Stage.DIGITAL, False)

    def signal(self, light: Light | Layers, view: View, nuisances: Nuisances, random: bool = False) -> np.ndarray:
        """Returns DN [height][width] of a light, black level included. random=False: the expected value, without random
        effects, and without rounding, whose mean error noise removes. random=True: one exposure. Values are rounded
        only by effects."""
        projector, ambient = scales(view.frame)
        value = (
            nuisances.projector_scale * projector * light.projector + nuisances.ambient_scale * ambient * light.ambient
        )
        return self.digital(value, view, nuisances.black_dn, random)

    def digital(self, value: np.ndarray, view: View, black_dn: float, random: bool = False) -> np.ndarray:
        """Returns DN as signal() does. value: DN above black [height][width] that an ideal sensor counts."""
        for effect, parameters in self._select(Stage.CHARGE, Stage.READOUT, random):
            value = effect.apply(value, view, **effect.on_pixels(parameters, view.binning))
        value = value + black_dn
        for effect, parameters in self._select(Stage.DIGITAL, Stage.DIGITAL, random):
            value = effect.apply(value, view, **effect.on_pixels(parameters, view.binning))
        return np.minimum(np.maximum(value, 0.0), view.max_dn)

    def depth(self, depth_m: np.ndarray, view: View, stream: dict[str, np.ndarray] | None = None) -> np.ndarray:
        """Returns the device's depth image from the matcher's: left camera, metres, 0 = none. view: the left camera's.

        stream: {effect id: its result for the frame before}, updated in place for effects that remember; None: the
        first frame of a stream.
        """
        stream = {} if stream is None else stream
        image, stage = np.asarray(depth_m, dtype=np.float64), Stage.DEPTH
        for effect, parameters in self._select(Stage.DISPARITY, Stage.DEPTH, True):
            if effect.stage is not stage:
                image, stage = inverse_depth(image, view), effect.stage
            seen = replace(view, before=stream.get(effect.id)) if effect.remembers else view
            image = effect.apply(image, seen, **parameters)
            if effect.remembers:
                stream[effect.id] = image
        return image if stage is Stage.DEPTH else inverse_depth(image, view)

    @property
    def remembers(self) -> bool:
        """Returns whether an effect on disparity or depth depends on the frame before."""
        return any(effect.remembers for effect, _ in self.effects)

    def _select(self, first: Stage, last: Stage, random: bool) -> tuple[tuple[Effect, dict[str, float]], ...]:
        chosen = [(e, p) for e, p in self.effects if first <= e.stage <= last]
        if not random:
            chosen = [(e, p) for e, p in chosen if e.is_in_mean]
        return tuple(sorted(chosen, key=lambda pair: pair[0].stage))


def acted(effect: Effect, parameters: dict[str, float], light: Light, view: View) -> Light:
    """Applies one effect, of a stage up to the lens, to a Light; returns the new Light."""
    own = effect.on_pixels(parameters, view.binning)
    if effect.stage is Stage.OPTICS:
        return light.map(lambda images: effect.apply(images, view, **own))
    if effect.is_pointwise:
        return light.pointwise(lambda some, there: effect.apply(some, there, **own), view)
    return effect.apply(light, view, **own)


def scales(frame: Frame) -> tuple[float, float]:
    """Returns a frame's factors (projector light, ambient light): exposure in seconds x gain, times the projector's
    power or the ambient level."""
    level = 1.0 if frame.ambient is None else frame.ambient
    return frame.exposure_gain * frame.projector_power, frame.exposure_gain * level


def inverse_depth(image: np.ndarray, view: View) -> np.ndarray:
    """Returns disparity in px from depth in m, or depth from disparity; 0 stays 0. view: the left camera's."""
    return np.where(image > 0, view.K[0, 0] * view.baseline_m / np.where(image > 0, image, 1.0), 0.0)
