# SPDX-License-Identifier: Apache-2.0
"""Computes the light of an observation and the sensor's response to it, and keeps light for the repeated calls of a
fit.

The nuisances phi are projector scale, ambient scale and black level; then, with priors, both cameras' relative focal
lengths, the materials' relative albedos, and twists of the geometry (evidence/geometry.py).
"""

from collections import OrderedDict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.nuisances import slopes
from activestereo.diagnose.evidence.observation import Observation
from activestereo.effects import Effect, Light, Model, View
from activestereo.effects.core.model import acted, scales

if TYPE_CHECKING:
    from activestereo.diagnose.refine.normal_equations import Pixels

# Lights to keep per observation: those after a model's first effects, before the last one.
_REMEMBERED = 3
# Attributes of a frame that effects may read if several frames share a light: first frames of one pose and motion,
# then also of one temperature.
_SHARED = ("camera_to_world", "camera_velocity", "is_moving")
_LEVELS = (_SHARED, (*_SHARED, "temperature_c"))
# Numbers of first entries of phi: scales and black level; the same with the focal lengths, which all pixels share.
SCALES, DENSE = 3, 5
_ONE_PIXEL = np.zeros(1, np.intp)


class _AskedForFrame(Exception):
    """Signals that an effect reads a frame's attribute that differs within a group of frames, so they cannot share
    light."""


class _SharedFrame:
    """Stands for a group of frames: gives effects the attributes that all have in common, and raises _AskedForFrame for
    others."""

    def __init__(self, frame: Frame, shared: tuple[str, ...]) -> None:
        self._frame, self._shared = frame, shared

    def __getattr__(self, name: str) -> Any:
        if name not in self._shared:
            raise _AskedForFrame(name)
        return getattr(self._frame, name)


class LightMemory:
    """Computes and caches the light on the sensor for each observation under a model. Only effects after the first
    changed one are applied again. Frames that are equal in all that an effect reads share one result."""

    def __init__(self, observations: Sequence[MeasuredImage]) -> None:
        self._observations = observations
        self._rendered: dict[int, tuple[Light, Light]] = {}  # by the layers, which frames of one pose share
        self._before: OrderedDict[tuple, Light] = OrderedDict()
        self._firsts = [_firsts_of_groups(observations, shared) for shared in _LEVELS]
        self._views: list[dict[int, View]] = []
        for shared, firsts in zip(_LEVELS, self._firsts, strict=True):
            self._views.append({i: _of_group(observations[i].view, shared) for i in set(firsts)})
        self._level: dict[Effect, int] = {}

    def __call__(self, model: Model, i: int, supersampled: bool = True) -> Light:
        """Returns the light of observation i that falls on the sensor. supersampled: as in Model.light."""
        chain = tuple((e, tuple(values.items())) for e, values in model.on_light())
        if not chain:
            return self._rendered_light(i)[supersampled]
        for level in range(max(self._level.get(effect, 0) for effect, _ in chain), len(_LEVELS)):
            first = self._firsts[level][i]
            if self._firsts[level].count(first) > 1:
                with suppress(_AskedForFrame):
                    return self._remembered(chain, first, supersampled, self._views[level][first])
        view = self._observations[i].view
        return self._acted(chain[-1], self._remembered(chain[:-1], i, supersampled, view), view)

    def _acted(self, link: tuple[Effect, tuple], light: Light, view: View) -> Light:
        effect, values = link
        try:
            after = acted(effect, dict(values), light, view)
            if effect.is_pointwise:
                after.at(_ONE_PIXEL)  # a pointwise effect acts only when pixels are read
            return after
        except _AskedForFrame as asked:
            self._level[effect] = 1 if str(asked) in _LEVELS[1] else len(_LEVELS)
            raise

    def _remembered(self, chain: tuple, i: int, supersampled: bool, view: View) -> Light:
        if not chain:
            return self._rendered_light(i)[supersampled]
        key = chain, i, supersampled, id(view)
        if key not in self._before:
            self._before[key] = self._acted(chain[-1], self._remembered(chain[:-1], i, supersampled, view), view)
            while len(self._before) > _REMEMBERED * len(self._observations):
                self._before.popitem(last=False)
        self._before.move_to_end(key)
        return self._before[key]

    def _rendered_light(self, i: int) -> tuple[Light, Light]:
        """Returns observation i's rendered light twice: with images of pixels alone, and with supersampled images as
        well."""
        layers = self._observations[i].layers
        if id(layers) not in self._rendered:
            light = Light.of(layers)
            self._rendered[id(layers)] = Light(light.direct, light.indirect, light.ambient, light.flat), light
        return self._rendered[id(layers)]


def _of_group(view: View, shared: tuple[str, ...]) -> View:
    """Returns a view as a group of frames shares it, the same one at every call: it keeps the geometry that effects
    compute."""
    kept: View = view.once(shared, lambda: replace(view, frame=cast(Frame, _SharedFrame(view.frame, shared))))
    return kept


def _firsts_of_groups(observations: Sequence[MeasuredImage], shared: tuple[str, ...]) -> list[int]:
    """Returns, for each observation, the index of the first one that shows the same light to an effect that reads only
    the shared attributes."""
    firsts: dict[tuple, int] = {}
    seen = (repr([np.asarray(getattr(o.frame, name)).tolist() for name in shared]) for o in observations)
    keys = ((o.side, id(o.layers), own) for o, own in zip(observations, seen, strict=True))
    return [firsts.setdefault(key, i) for i, key in enumerate(keys)]


class AllPixels:
    """All pixels of an observation in the image's order, with the same fields as normal_equations.Pixels."""

    def __init__(self, observation: Observation) -> None:
        self.observation = observation
        self.index = slice(None)
        self.measured, self.material = observation.measured.ravel(), observation.material.ravel()
        self.focal_slope = observation.focal_slope.ravel()
        self.geometry_slopes = observation.geometry_slopes.reshape(-1, observation.measured.size)

    def gather(self, image: np.ndarray) -> np.ndarray:
        return image.ravel()


def exposed(
    model: Model, pixels: "Pixels | AllPixels", light: Light, phi: np.ndarray, with_slopes: bool = False
) -> tuple[np.ndarray, list[np.ndarray] | None]:
    """Returns (expected DN [n] before corrections of focal lengths and geometry; its derivatives [n] by projector
    scale, ambient scale and black level, or None without with_slopes)."""
    if not model.is_linear:
        return _through_sensor(model, pixels, light, phi, with_slopes)
    view = pixels.observation.view
    projector, ambient = _sent(pixels, light, phi)
    value = phi[0] * projector
    value += phi[1] * ambient
    value += phi[2]
    if not with_slopes:
        return np.clip(value, 0.0, view.max_dn, out=value), None
    inside = ((value > 0.0) & (value < view.max_dn)).astype(np.float64)
    image = np.clip(value, 0.0, view.max_dn, out=value)
    return image, [projector * inside, ambient * inside, inside]


def _sent(pixels: "Pixels | AllPixels", light: Light, phi: np.ndarray) -> list[np.ndarray]:
    """Returns the projector's and the ambient light at the pixels, [n] each, DN per unit scale. Each is multiplied by
    the fitted correction of its material's albedo."""
    levels, lights = scales(pixels.observation.view.frame), light.seen(pixels.index)
    if not phi[DENSE:].any():
        return [level * seen for level, seen in zip(levels, lights, strict=True)]
    gain = np.append(1.0 + phi[DENSE:], 1.0)[pixels.material]
    sent = []
    for level, seen in zip(levels, lights, strict=True):
        sent.append(level * gain)
        sent[-1] *= seen
    return sent


def _through_sensor(
    model: Model, pixels: "Pixels | AllPixels", light: Light, phi: np.ndarray, with_slopes: bool
) -> tuple[np.ndarray, list[np.ndarray] | None]:
    """Computes exposed() for a model with effects on the sensor, which need whole images."""
    whole = AllPixels(pixels.observation)
    view, shape = pixels.observation.view, pixels.observation.measured.shape
    projector, ambient = _sent(whole, light, phi)

    def image(projector_scale: float, ambient_scale: float, black_dn: float) -> np.ndarray:
        value = projector_scale * projector + ambient_scale * ambient
        return pixels.gather(model.digital(value.reshape(shape), view, black_dn))

    return slopes(image, phi[:SCALES]) if with_slopes else (image(*phi[:SCALES]), None)
