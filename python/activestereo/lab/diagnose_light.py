"""What a fit asks again and again: the light of an observation under a model, and the numbers that a sensor makes of it."""

from collections import OrderedDict
from threading import Lock

import numpy as np

from activestereo.effects import Light
from activestereo.effects.core.model import acted, scales

# Lights that are remembered, per observation: those of a model's first effects, before the last one.
_REMEMBERED = 3
# Of the nuisances phi: projector scale, ambient scale, black level; then those with priors: focal length by eye, albedos.
SCALES, DENSE = 3, 5
_STEP = 1e-3


class LightMemory:
    """Lights of observations under models; effects that came earlier on the light's way are not applied anew when a later one changes."""

    def __init__(self, observations):
        self._observations = observations
        self._rendered = [None] * len(observations)
        self._before, self._lock = OrderedDict(), Lock()

    def __call__(self, model, i, fine=True):
        """The Light of observation i that falls on the sensor; fine: see Model.light."""
        *first, last = ((None, ()), *((e, tuple(values.items())) for e, values in model.on_light()))
        return self._acted(last, self._remembered(tuple(first), i, fine), i, fine)

    def _acted(self, link, light, i, fine):
        effect, values = link
        if effect is None:
            return self._of_layers(i)[fine]
        return acted(effect, dict(values), light, self._observations[i].view)

    def _remembered(self, chain, i, fine):
        if len(chain) < 2:
            return self._of_layers(i)[fine]
        key = chain, i, fine
        with self._lock:
            if key in self._before:
                self._before.move_to_end(key)
                return self._before[key]
        light = self._acted(chain[-1], self._remembered(chain[:-1], i, fine), i, fine)
        with self._lock:
            self._before[key] = light
            while len(self._before) > _REMEMBERED * len(self._observations):
                self._before.popitem(last=False)
        return light

    def _of_layers(self, i):
        if self._rendered[i] is None:
            light = Light.of(self._observations[i].layers)
            self._rendered[i] = Light(light.direct, light.indirect, light.ambient, light.flat), light
        return self._rendered[i]


class AllPixels:
    """As diagnose_sums.Pixels: every pixel of an observation, in the image's order."""

    def __init__(self, observation):
        self.observation = observation
        self.index = slice(None)
        self.measured, self.material = observation.measured.ravel(), observation.material.ravel()
        self.focal_slope = observation.focal_slope.ravel()

    def of(self, image):
        return image.ravel()


def exposed(model, pixels, light, phi, with_slopes=False):
    """(expected DN without the focal lengths' part, its derivatives by projector scale, ambient scale and black level), [n] each;
    the derivatives are None without with_slopes."""
    if not model.is_linear:
        return _through_sensor(model, pixels, light, phi, with_slopes)
    view = pixels.observation.view
    projector, ambient = _sent(pixels, light, phi)
    value = phi[0] * projector + phi[1] * ambient + phi[2]
    image = np.minimum(np.maximum(value, 0.0), view.max_dn)
    if not with_slopes:
        return image, None
    inside = ((value > 0.0) & (value < view.max_dn)).astype(np.float64)
    return image, [projector * inside, ambient * inside, inside]


def _sent(pixels, light, phi):
    """DN per projector and ambient scale, with each material's relative albedo correction: it scales all light that the material sends."""
    levels = scales(pixels.observation.view.frame)
    gain = 1.0
    if phi[DENSE:].any():
        gain = np.append(1.0 + phi[DENSE:], 1.0)[pixels.material]
    return [level * gain * seen for level, seen in zip(levels, light.seen(pixels.index), strict=True)]


def _through_sensor(model, pixels, light, phi, with_slopes):
    """exposed() where effects act on the sensor: they see whole images."""
    whole = AllPixels(pixels.observation)
    view, shape = pixels.observation.view, pixels.observation.measured.shape
    projector, ambient = _sent(whole, light, phi)

    def image(projector_scale, ambient_scale, black_dn):
        value = projector_scale * projector + ambient_scale * ambient
        return pixels.of(model.digital(value.reshape(shape), view, black_dn))

    here = image(*phi[:SCALES])
    if not with_slopes:
        return here, None
    columns = []
    for j in range(SCALES):
        moved = phi[:SCALES].copy()
        step = _STEP * max(abs(phi[j]), 1.0)
        moved[j] += step
        columns.append((image(*moved) - here) / step)
    return here, columns
