# SPDX-License-Identifier: Apache-2.0
"""Computes columns: how each effect, and each error of the calibration, changes every image of a room.

An effect's column is the difference that its image function makes to the expected light. The dots were measured by the
same camera, so they already contain an effect on dots. It shows only as a difference between the cameras of a pair.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image, normals_of, pixel_grid, points_of
from activestereo.capture.capture import SIDES
from activestereo.diagnose.room.bands import BANDS
from activestereo.diagnose.room.light import RoomLight
from activestereo.effects import Effect, Light, Stage, View
from activestereo.effects.core.descriptor import Channel, Parameter
from activestereo.effects.core.model import acted

# Warps are linear only in small steps: this share of the typical value.
_STEP_OF_A_WARP = 0.1
_REACH = 2.0
# Effects that move light do not change the dots' amplitude. Effects that scale it show in slow light, and in the pair
# if its cameras differ. Elsewhere their columns would hold remainders of textures and dots.
_MOVED, _SCALED, _OF_ONE_CAMERA = ("slow", "fine", "pair"), ("slow",), ("slow", "pair")
_APART = 0.25
# Prior standard deviations of nuisances that no calibration measured.
_TURN_RAD, _MOVE_M, _FOCAL, _BASELINE_M, _NEAREST_M = 5e-4, 5e-4, 0.003, 1e-3, 0.3
_SLOW_LAW, _DOTS_LIGHT, _BLACK_DN, _EXPONENT = 0.03, 1.0, 1.5, 0.5
# Flicker bands over the height of an image: rows are read in 4 to 36 ms, mains light has 100 or 120 periods a second.
_CYCLES = tuple(0.4 + 0.2 * k for k in range(21))
_PERIODIC, _GHOST = "flicker_banding", "lens_ghost"
# A pane that stands off the axis by these angles moves its ghost by twice as much; rooms' slow light tells half of one.
_PANE_DEG = (-1.5, -0.75, 0.0, 0.75, 1.5)
# Penalty in nats for a search: logarithm of an effect's number of alternatives.
LOOKED = {_PERIODIC: float(np.log(len(_CYCLES))), _GHOST: 2.0 * float(np.log(len(_PANE_DEG)))}
_TONE, BEND = "response_gamma", ".bend"  # the end of the name of a response's saturation column
_SATURATION = 2.0  # a quadratic law would miss half of what a soft response does to bright rooms
# Shares of a parameter's range at which an effect's size is looked up.
_LADDER = np.geomspace(0.02, 1.0, 9)

Change = Callable[[int, Image], Image]
Flow = Callable[[int], tuple[Image, Image]]


@dataclass(frozen=True)
class Column:
    """How one effect, or one calibration error, changes images of a room at coefficient 1. sd: prior standard deviation
    of the coefficient. images: indices of the images that change. law(image index, light above black in DN): returns
    the change in DN. flow(image index): in place of law, returns the light's displacement (x, y) in px, each
    [height][width]. effect, parameter: None for a nuisance. step: the parameter's change at coefficient 1. bands: those
    in which the column counts. alike: factor on the spread among good units."""

    name: str
    sd: float
    images: range
    law: Change | None = None
    effect: Effect | None = None
    parameter: Parameter | None = None
    step: float = 1.0
    bands: tuple[str, ...] = BANDS
    flow: Flow | None = None
    alike: float = 1.0

    def change(self, k: int, image: Image) -> Image:
        """Returns the change in DN of image k at coefficient 1. image: its light above black, DN."""
        return self.law(k, image) if self.law is not None else gradient_change(image, *self.moves(k))

    def moves(self, k: int) -> tuple[Image, Image]:
        """Returns the displacement (x, y) of the light in image k, px; 0 in images that do not change."""
        assert self.flow is not None
        dx, dy = self.flow(k)
        return (dx, dy) if k in self.images else (0 * dx, 0 * dy)


def gradient_change(image: Image, dx: Image, dy: Image) -> Image:
    """Returns the change in DN of an image whose light moves by (dx, dy) pixels, each [height][width]. It is the
    first-order change, from the image's gradient."""
    down, across = np.gradient(image)
    return np.asarray(-(dx * across + dy * down), np.float32)


# Shares of the light at the ray (x, y, 1) by which a view's smooth light may be off: bounces,
# gloss, changes of the room.
_SLOW_LAWS: dict[str, Callable[[Image, Image], Image]] = {
    "x": lambda x, y: x, "y": lambda x, y: y, "xx": lambda x, y: x * x, "xy": lambda x, y: x * y,
    "yy": lambda x, y: y * y,
}  # fmt: skip
# Displacements at the ray (x, y, 1), as shares of the focal length, of a camera that turns or moves about each axis.
# near: 1 / depth.
_RIGID: dict[str, Callable[[Image, Image, Image], tuple[Image, Image]]] = {
    "turn x": lambda x, y, near: (x * y, 1 + y * y),
    "move x": lambda x, y, near: (-near, 0 * near),
    "turn y": lambda x, y, near: (-1 - x * x, -x * y),
    "move y": lambda x, y, near: (0 * near, -near),
    "turn z": lambda x, y, near: (y, -x),
    "move z": lambda x, y, near: (x * near, y * near),
}


def nuisances(room: Room, light: RoomLight) -> list[Column]:
    """Returns the nuisance columns: errors of exposure, falloff, geometry and black level that `calibrate world`
    leaves, and smooth light that no model explains. Names and units are those of the calibration's joint covariance."""
    out: list[Column] = []
    images, f, ones = range(len(room.images)), np.float32(room.images[0].K[0, 0]), np.ones(room.shape, np.float32)
    judged, right = range(2 * room.judged), range(1, 2 * room.judged, 2)  # a good session has its own common errors

    def scaled(name: str, sd: float, on: range, share: Callable[[Image, Image], Image]) -> None:
        out.append(Column(name, sd, on, lambda k, image: share(*room.images[k].rays()) * image))

    def moved(
        name: str, sd: float, on: range, law: Callable[[Image, Image, Image], tuple[Image, Image]], px: np.float32 = f
    ) -> None:
        def flow(k: int) -> tuple[Image, Image]:
            dx, dy = law(*room.images[k].rays(), 1.0 / np.maximum(room.images[k].depth_m, _NEAREST_M))
            return px * dx, px * dy

        out.append(Column(name, sd, on, flow=flow, bands=_MOVED))

    for view in range(1, room.views):
        scaled(f"exposure {room.name(view)}", 0.1, of_view(view), lambda x, y: ones)
    for view in range(room.views):
        for name, law in _SLOW_LAWS.items():
            scaled(f"slow {name} {view}", _SLOW_LAW, of_view(view), law)
    scaled("falloff", _EXPONENT, images, lambda x, y: -0.5 * np.log1p(x * x + y * y))
    scaled("falloff r^4", 0.1, images, lambda x, y: np.square(x * x + y * y))
    for first, side in enumerate(SIDES):
        for axis in "xy":
            scaled(f"falloff tilt {axis} {side}", 0.05, images[first::2], _SLOW_LAWS[axis])
    for view in range(1, room.views):
        for name, rigid in _RIGID.items():
            sd = _TURN_RAD if name.startswith("turn") else _MOVE_M
            moved(f"{name} {room.name(view)}", sd, of_view(view), rigid)
    moved("right column", 1.0, right, lambda x, y, near: (ones, 0 * ones), np.float32(0.5))
    moved("right row", 1.0, right, lambda x, y, near: (0 * ones, ones), np.float32(0.5))
    moved("baseline", _BASELINE_M, right, lambda x, y, near: (-near, 0 * near))
    moved("focal length", _FOCAL, judged, lambda x, y, near: (x, y))
    out.append(Column("black", _BLACK_DN, images, lambda k, image: ones))
    # A wrong dark level of the pattern between dots adds smooth light to the room's.
    dots = lambda k, image: light.looks[k].even(light.looks[k].amplitude(light.seen[k]))  # noqa: E731
    return [*out, Column("light between dots", _DOTS_LIGHT, images, dots, bands=("slow", "fine"))]


def of_view(view: int) -> range:
    """Returns the indices of a view's two images."""
    return range(2 * view, 2 * view + 2)


def prior_precision(room: Room, columns: Sequence[Column]) -> NDArray[np.float64]:
    """Returns the inverse of the columns' prior covariance, [c][c]. It is the calibration's joint covariance for
    columns that it holds, and sd^2 for the others."""
    told, joint = room.joint
    covariance = np.diag([c.sd**2 for c in columns])
    own = [j for j, c in enumerate(columns) if c.effect is None and c.name in told]
    at = [told.index(columns[j].name) for j in own]
    covariance[np.ix_(own, own)] = joint[np.ix_(at, at)]
    return np.asarray(np.linalg.inv(covariance))


def effects_of(room: Room, light: RoomLight, effects: Mapping[str, Effect]) -> list[Column]:
    """Returns columns of effects in the camera, one for each parameter that alone changes an image. Lens falloff, which
    is a nuisance of every room, and effects with alternatives() are left out."""
    views, judged = [view_of(room, k) for k in range(len(room.images))], range(2 * room.judged)
    out: list[Column] = []
    for effect in effects.values():
        if effect.id in ("vignetting", _GHOST) or not is_alike_in_views(effect):
            continue
        lead = effect.parameters[0]
        for p in (p for p in effect.parameters if lead.neutral == p.neutral == 0.0):
            share = _share(effect)
            value = min(p.typical_value * share, p.high)
            image = light.room[0]
            if p is not lead and not np.any(acting(effect, {p.name: p.typical_value}, image, views[0], 0.0) != image):
                continue  # it needs another value of the effect's first parameter
            flow = _flow_of(effect, p, value, share, views) if share < 1.0 else None
            law = None if flow is not None else _difference(effect, p, value, views, light.black_dn)
            column = Column(f"{effect.id}.{p.name}", _REACH, judged, law, effect, p, value / share, _MOVED, flow)
            if effect.stage is not Stage.CAMERA:
                # A change may differ more between the cameras of a view than their different positions explain.
                left, right = (column.change(k, light.room[0]) for k in (0, 1))
                differs = np.square(left - right).sum() > _APART * np.square(left).sum()
                column = replace(column, bands=_OF_ONE_CAMERA if differs else _SCALED)
            out.append(column)
            if effect.id == _TONE:
                bend = _bend(column.change, light, room.rig.max_dn)
                out.append(replace(column, name=f"{effect.id}{BEND}", law=bend))
    return out


def _bend(power: Change, light: RoomLight, full_dn: float) -> Change:
    """Returns the image change by a saturation x / (1 + 2 x), minus the parts that an exponent (`power`) or an exposure
    explains. It stands for responses that differ in the dark, which would otherwise pass for a black level. full_dn:
    the largest DN."""
    x = light.both[0]

    def saturated_law(k: int, image: Image) -> Image:
        return image / (1.0 + _SATURATION * np.maximum(image, 0.0) / full_dn)

    laws = [saturated_law, power, lambda k, image: image]
    saturated, *others = (np.asarray(law(0, x)).ravel() for law in laws)
    share = np.linalg.lstsq(np.stack(others, axis=1), saturated, rcond=None)[0]
    scale = np.float32(np.linalg.norm(others[0]) / max(float(np.linalg.norm(saturated)), 1e-9))

    def change(k: int, image: Image) -> Image:
        soft, exponent, exposure = (law(k, image) for law in laws)
        return scale * (soft - share[0] * exponent - share[1] * exposure)

    return change


def is_warp(effect: Effect) -> bool:
    """Returns whether an effect moves the light within an image."""
    return effect.stage is Stage.CAMERA and not effect.id.endswith(("psf", "mismatch"))


def _share(effect: Effect) -> float:
    """Returns the finite-difference step of an effect's columns, as a share of the parameter's typical value."""
    return _STEP_OF_A_WARP if is_warp(effect) else 1.0


def is_alike_in_views(effect: Effect) -> bool:
    """Returns whether an effect in the camera changes all views by one law, without chance."""
    if effect.id in (_PERIODIC, "black_level"):
        return False
    return Stage.CAMERA <= effect.stage <= Stage.DIGITAL and effect.channel is Channel.EXPECTED_IMAGE


def _difference(effect: Effect, p: Parameter, value: float, views: list[View], black_dn: float) -> Change:
    acts = lambda k, image: acting(effect, {p.name: value}, image, views[k], black_dn)  # noqa: E731
    return lambda k, image: np.asarray(acts(k, image) - image, np.float32)


def _flow_of(effect: Effect, p: Parameter, value: float, share: float, views: list[View]) -> Flow:
    """Returns a function from an image's index to the displacement field of a warp. It applies the effect to images
    that hold each pixel's own column or row. value: of parameter p. share: value over its typical value."""

    @cache
    def flow(k: int) -> tuple[Image, Image]:
        dx, dy = (
            np.asarray((ramp - acting(effect, {p.name: value}, ramp, views[k], 0.0)) / share, np.float32)
            for ramp in pixel_grid(views[k].depth_m.shape)
        )
        return dx, dy

    return flow


def acting(effect: Effect, values: Mapping[str, float], image: Image, view: View, black_dn: float) -> Image:
    """Applies one effect to an image of light above black, DN [height][width]; returns the changed light."""
    given = effect.values(values)
    if effect.stage <= Stage.OPTICS:
        nothing = np.zeros_like(image, np.float64)
        light = Light.of_images([nothing, nothing, image.astype(np.float64), nothing])
        return np.asarray(acted(effect, given, light, view).ambient)
    own = effect.on_pixels(given, view.binning)
    offset = black_dn if effect.stage is Stage.DIGITAL else 0.0
    return np.asarray(effect.apply(image.astype(np.float64) + offset, view, **own) - offset)


def size_of(room: Room, light: RoomLight, column: Column, sign: float = 1.0) -> Callable[[float], tuple[float, float]]:
    """Returns a function of a fitted coefficient in the parameter's unit, which has this sign. It returns (the
    parameter's value whose true image change is as large along the column, its derivative by the coefficient). The two
    are not proportional: a blur grows as the square of its width."""
    effect, p = column.effect, column.parameter
    assert effect is not None and p is not None
    sign = sign if p.low < p.neutral else 1.0
    limit = p.high if sign > 0.0 else -p.low
    step, values = min(p.typical_value * _share(effect), limit), np.r_[0.0, limit * _LADDER]
    along = np.zeros(len(values))
    for k in (0, 1):
        view, image = view_of(room, k), light.both[k]
        acted_on = (acting(effect, {p.name: sign * x}, image, view, light.black_dn) for x in (step, *values))
        changes: Iterator[Image] = ((seen - image).astype(np.float32) for seen in acted_on)
        if "fine" in column.bands:
            changes = map(light.looks[k].pair, changes)
        unit = next(changes)
        if square := float((unit * unit).sum()):
            along = np.maximum.accumulate([step * float((change * unit).sum()) / square for change in changes])
            break

    def size(linear: float) -> tuple[float, float]:
        if abs(linear) > along[-1]:
            return linear, 1.0
        value, beside = np.interp([abs(linear), 1.01 * abs(linear) + 1e-9], along, values)
        return float(sign * value), float((beside - value) / (0.01 * abs(linear) + 1e-9))

    return size


def view_of(room: Room, k: int) -> View:
    """Returns the View of image k, which holds all that an effect may know of it."""
    image, rig = room.images[k], room.rig
    to_camera = np.eye(4) if image.side == "left" else rig.left_to_right
    normal = normals_of(points_of(image.depth_m, image.K)).astype(np.float64)
    return View(
        image.side, image.K, image.depth_m.astype(np.float64), normal, rig.projector.pattern(), rig.projector.K,
        rig.projector.left_to_projector @ np.linalg.inv(to_camera), to_camera, image.frame, rig.max_dn,
        baseline_m=rig.baseline_m, binning=2,
    )  # fmt: skip


def pedestals(room: Room, effects: Mapping[str, Effect]) -> list[Column]:
    """Returns one column per view for a black level that differs between views; empty if `effects` has no
    "black_level"."""
    effect = effects.get("black_level")
    if effect is None:
        return []
    p = effect.parameters[0]
    one = np.full(room.shape, p.typical, np.float32)
    first = 1 if room.judged == room.views else 0  # without a good session the first one is in the measured black level
    return [Column(f"black_level.{v}", 1.0, of_view(v), lambda k, image: one, effect, p, p.typical, _SCALED)
            for v in range(first, room.judged)]  # fmt: skip


def alternatives(
    room: Room, light: RoomLight, effects: Mapping[str, Effect]
) -> dict[str, dict[tuple[float, ...], list[Column]]]:
    """Returns {effect: {alternative: its columns}} for effects with a parameter to search: for lamp flicker the period
    in rows of the full-size image, for a ghost the angles of its pane to the sensor, degrees about y and x."""
    each = {_PERIODIC: lambda effect: _waves(room, effect), _GHOST: lambda effect: _ghosts(room, light, effect)}
    return {name: found(effects[name]) for name, found in each.items() if name in effects}


def _ghosts(room: Room, light: RoomLight, effect: Effect) -> dict[tuple[float, ...], list[Column]]:
    """Returns {pane angles in degrees: the ghost's column}. A ghost of dots is smooth light elsewhere in the image, so
    the ghost is computed from all light."""
    p, out = effect.parameters[0], dict[tuple[float, ...], list[Column]]()
    views = [view_of(room, k) for k in range(len(room.images))]
    lit = [of_room + dots for of_room, dots in zip(light.room, light.dots, strict=True)]
    for pane in itertools.product(_PANE_DEG, repeat=2):
        moved = np.zeros((3, 3))
        moved[:2, 2] = room.images[0].K[0, 0] * np.tan(np.radians(pane))
        acts = _difference(effect, p, p.typical, [replace(v, K=v.K + moved) for v in views], light.black_dn)
        change = lambda k, image, acts=acts: acts(k, lit[k])  # noqa: E731
        out[pane] = [
            Column(f"{effect.id}.{p.name}", _REACH, range(2 * room.judged), change, effect, p, p.typical, _SCALED)
        ]
    return out


def _waves(room: Room, effect: Effect) -> dict[tuple[float, ...], list[Column]]:
    """Returns {period in rows: flicker columns}. Each view has a sine and a cosine column, so that its phase is
    free."""
    p, out = effect.parameters[0], dict[tuple[float, ...], list[Column]]()
    rows = np.arange(room.shape[0], dtype=np.float32)[:, None] * 2 + 0.5
    for cycles in _CYCLES:
        period = round(2 * room.shape[0] / cycles)
        angle = 2.0 * np.pi * rows / period
        out[period,] = [
            Column(f"{_PERIODIC}.{view} {name}", 0.5, of_view(view), _times(wave), effect, p, p.typical, _SCALED,
                   alike=1.0 / (1.0 + cycles**2))
            for view in range(room.judged)
            for name, wave in (("sine", p.typical * np.sin(angle)), ("cosine", p.typical * np.cos(angle)))
        ]  # fmt: skip
    return out


def _times(factor: Image) -> Change:
    return lambda k, image: factor * image
