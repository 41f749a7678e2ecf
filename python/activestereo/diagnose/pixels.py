# SPDX-License-Identifier: Apache-2.0
"""The light of observations, their expected images, and the normal equations of a fit: sums over pixels.

The nuisances phi are, in order: projector scale, ambient scale, black level; then, with priors, both cameras' relative
focal lengths, the materials' relative albedos, and twists of the geometry (geometry.py).
"""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeAlias, cast

import numpy as np

from activestereo.capture.capture import SIDES, Frame
from activestereo.common.computed_once import computed_once
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.nuisances import slopes
from activestereo.diagnose.evidence import BLOCK_PX, Observation
from activestereo.effects import Effect, Light, Model, View
from activestereo.effects.core.model import acted, scales

# Lights to keep per observation: those after a model's first effects, before the last one. Of images with more pixels
# one is kept, because they take gigabytes.
_REMEMBERED, _LARGE_PIXELS = 3, 250_000
# Attributes of a frame that effects may read if several frames share a light: first frames of one pose and motion,
# then also of one temperature.
_SHARED = ("camera_to_world", "camera_velocity", "is_moving")
_LEVELS = (_SHARED, (*_SHARED, "temperature_c"))
# Numbers of first entries of phi: scales and black level; the same with the focal lengths, which all pixels share.
SCALES, DENSE = 3, 5
_ONE_PIXEL = np.zeros(1, np.intp)
_PLAIN = ("gram", "moment", "tile_chi2")


class _AskedForFrame(Exception):
    """Signals that an effect reads a frame's attribute that differs within a group of frames, so they cannot share
    light."""


class _SharedFrame:
    """Stands for a group of frames. It gives effects the attributes that all these frames share, and raises
    _AskedForFrame for all others."""

    def __init__(self, frame: Frame, shared: tuple[str, ...]) -> None:
        self._frame, self._shared = frame, shared

    def __getattr__(self, name: str) -> Any:
        if name not in self._shared:
            raise _AskedForFrame(name)
        return getattr(self._frame, name)


class LightMemory:
    """Computes and caches the light on the sensor for each observation under a model. Only the first changed effect and
    those after it are applied again. Frames that are equal in all that the effects read share one result."""

    def __init__(self, observations: Sequence[MeasuredImage]) -> None:
        self._observations = observations
        self._rendered: dict[int, tuple[Light, Light]] = {}  # by the layers, which frames of one pose share
        self._before: OrderedDict[tuple, Light] = OrderedDict()
        is_large = any(o.layers.direct.size > _LARGE_PIXELS for o in observations)
        self._most = len(observations) * (1 if is_large else _REMEMBERED)
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
            while len(self._before) > self._most:
                self._before.popitem(last=False)
        self._before.move_to_end(key)
        return self._before[key]

    def _rendered_light(self, i: int) -> tuple[Light, Light]:
        """Returns observation i's rendered light twice: without and with supersampled images."""
        layers = self._observations[i].layers
        if id(layers) not in self._rendered:
            light = Light.of(layers)
            self._rendered[id(layers)] = Light(light.direct, light.indirect, light.ambient, light.flat), light
        return self._rendered[id(layers)]


def _of_group(view: View, shared: tuple[str, ...]) -> View:
    """Returns a view whose frame has only the attributes `shared`. Every call returns the same object, because it
    caches geometry that effects compute."""
    kept: View = view.once(shared, lambda: replace(view, frame=cast(Frame, _SharedFrame(view.frame, shared))))
    return kept


def _firsts_of_groups(observations: Sequence[MeasuredImage], shared: tuple[str, ...]) -> list[int]:
    """Returns, for each observation, the index of the first one with the same camera, layers and `shared` attributes of
    the frame. Effects that read no other attribute change both alike."""
    firsts: dict[tuple, int] = {}
    seen = (repr([np.asarray(getattr(o.frame, name)).tolist() for name in shared]) for o in observations)
    keys = ((o.side, id(o.layers), own) for o, own in zip(observations, seen, strict=True))
    return [firsts.setdefault(key, i) for i, key in enumerate(keys)]


class AllPixels:
    """All pixels of an observation in the image's order, with those fields of Pixels that signal() needs."""

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
    """Returns (expected DN [n] before corrections of focal lengths and geometry, its derivatives). The derivatives are
    [n] each, by projector scale, ambient scale and black level; None without with_slopes."""
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
    """Returns [projector light, ambient light] at the pixels, each [n] in DN per unit of its scale. Both are multiplied
    by the fitted correction of the pixel's albedo."""
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


class Pixels:
    """The pixels of an Observation that count, sorted by material; all arrays are [n].

    index: into the flattened image. measured: DN. root_weight: 1 / standard deviation, 1/DN. material: index of the
    albedo nuisance, -1 = none. tile: index of the image tile.
    """

    def __init__(self, observation: Observation, materials: int) -> None:
        o = observation
        index = np.arange(o.measured.size) if o.pick is None else o.pick
        label = np.where(o.material >= 0, o.material, materials).ravel()[index]
        order = np.argsort(label, kind="stable")
        self.observation, self.index, label = o, index[order], label[order]
        self.measured = self.gather(o.measured).astype(np.float64)
        self.root_weight = np.sqrt(self.gather(o.weight).astype(np.float64))
        self.material, self.tile = self.gather(o.material), self.gather(o.tile)
        self.focal_slope = self.gather(o.focal_slope).astype(np.float64)
        self.geometry_slopes = o.geometry_slopes.reshape(-1, o.measured.size).take(self.index, axis=1)
        self.geometry = self.geometry_slopes * self.root_weight.astype(np.float32)
        ends = np.searchsorted(label, np.arange(materials + 1))
        self.materials, self._runs = materials, [slice(first, last) for first, last in pairwise(ends)]

    def gather(self, image: np.ndarray) -> np.ndarray:
        """Returns an image's values at these pixels."""
        return image.ravel()[self.index]

    @computed_once
    def block(self) -> np.ndarray:
        """Returns the index of each pixel's block, [n]. Blocks are squares of BLOCK_PX pixels a side."""
        height, width = self.observation.measured.shape
        rows, columns = np.arange(height) // BLOCK_PX, np.arange(width) // BLOCK_PX
        return self.gather(np.add.outer(rows * (width // BLOCK_PX + 1), columns))

    @computed_once
    def geometry_gram(self) -> np.ndarray:
        """Returns the inner products of the weighted geometry slopes, [12][12]. They are the same in all fits."""
        return self.geometry @ self.geometry.T

    def by_material(self, values: np.ndarray, factor: np.ndarray) -> np.ndarray:
        """Returns, for each material, the sum over its pixels of values [k][n] times factor [n]: [k][materials]."""
        return np.stack([values[:, run] @ factor[run] for run in self._runs], axis=1)


Cluster: TypeAlias = tuple[str, bytes, bool]


def cluster_of(o: Observation) -> Cluster:
    """Returns the key of an observation's cluster, within which errors are shared: one camera at one pose, all repeats
    and settings."""
    return o.side, o.frame.camera_to_world.tobytes(), o.frame.is_moving


@dataclass
class Sums:
    """The normal equations of a linearisation: gram [n][n], moment [n] and chi2 by tile. block_moment: {cluster: moment
    in each block, [n][blocks]}."""

    gram: np.ndarray
    moment: np.ndarray
    tile_chi2: np.ndarray
    block_moment: dict[Cluster, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, np.ndarray], observations: Sequence[Observation]) -> "Sums":
        """Makes Sums from the result of as_arrays(). observations: those that were summed, in the same order."""
        clusters = dict.fromkeys(map(cluster_of, observations))
        blocks = {cluster: arrays[f"block_{i}"] for i, cluster in enumerate(clusters) if f"block_{i}" in arrays}
        gram, moment, tile_chi2 = (arrays[name] for name in _PLAIN)
        return cls(gram, moment, tile_chi2, blocks)

    def as_arrays(self) -> dict[str, np.ndarray]:
        """Returns the sums as named arrays; those by block are numbered in the order of the observations."""
        blocks = {f"block_{i}": moment for i, moment in enumerate(self.block_moment.values())}
        return {name: getattr(self, name) for name in _PLAIN} | blocks

    @property
    def total(self) -> float:
        return float(self.tile_chi2.sum())

    def add(
        self, pixels: Pixels, columns: list[np.ndarray], residual: np.ndarray, phi: np.ndarray, has_blocks: bool
    ) -> None:
        """Adds one observation; its moments by block only with has_blocks.

        columns: derivatives [k][n] by all parameters except albedos and geometry. An albedo's derivative is the light
        that the material sends. It is computed from the columns of projector and ambient scale times their scales.
        """
        dense, n_theta, materials = len(columns), len(columns) - DENSE, pixels.materials
        own = dense - len(SIDES) + pixels.observation.geometry_places  # the twelve numbers that move the observation
        A, r = np.stack(columns), residual * pixels.root_weight
        A *= pixels.root_weight
        single, geometry = np.vstack([A, r]).astype(np.float32), pixels.geometry
        self.tile_chi2 += np.bincount(pixels.tile, r * r, minlength=len(self.tile_chi2))
        self.gram[:dense, :dense] += A @ A.T
        self.moment[:dense] += A @ r
        cross = geometry @ single.T
        self.gram[:dense, own] += cross[:, :-1].T
        self.gram[own, :dense] += cross[:, :-1]
        self.gram[np.ix_(own, own)] += pixels.geometry_gram()
        self.moment[own] += cross[:, -1]
        if materials:
            glow = A[n_theta] * phi[0] + A[n_theta + 1] * phi[1]
            diagonal, rows = np.arange(dense, dense + materials), np.concatenate([np.arange(dense), own])
            *sums, square, force = pixels.by_material(np.vstack([A, glow, r]), glow)
            self.gram[diagonal, diagonal] += square
            self.moment[diagonal] += force
            both = np.concatenate([np.array(sums), pixels.by_material(geometry, glow.astype(np.float32))])
            self.gram[np.ix_(rows, diagonal)] += both
            self.gram[np.ix_(diagonal, rows)] += both.T
        if not has_blocks:
            return
        force, block = residual * pixels.root_weight**2, pixels.block()
        blocks = int(block.max()) + 1
        moment = np.zeros((len(self.moment), blocks))
        for j, column in zip([*range(dense), *own], [*columns, *pixels.geometry_slopes], strict=True):
            moment[j] = np.bincount(block, column * force, minlength=blocks)
        sent = (columns[n_theta] * phi[0] + columns[n_theta + 1] * phi[1]) * force
        # The last row is of pixels without a material and is dropped.
        label = np.where(pixels.material >= 0, pixels.material, materials) * blocks + block
        by_material = np.bincount(label, sent, minlength=(materials + 1) * blocks)
        moment[dense : dense + materials] = by_material.reshape(-1, blocks)[:-1]
        cluster = cluster_of(pixels.observation)
        self.block_moment[cluster] = self.block_moment.get(cluster, 0.0) + moment
