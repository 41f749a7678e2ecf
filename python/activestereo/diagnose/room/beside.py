# SPDX-License-Identifier: Apache-2.0
"""Finds effects that no column shows: row noise, drops on a window, a row offset between cameras that good sessions
lack, a bent response by two exposures, and lens falloff."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.light import LINEAR
from activestereo.calibrate.world.views import Image
from activestereo.capture.capture import SIDES
from activestereo.diagnose.room.bands import blur
from activestereo.diagnose.room.evidence import NEEDED, ONE_SIDED, Found, gaussian, student
from activestereo.diagnose.room.sessions import FEW
from activestereo.effects import Effect

# Rows: strips of an image, the largest difference of neighbours that is noise, and rows that are averaged for an error.
_STRIPS, _MOST_DN, _ROWS = 6, 4.0, 20
# Variance of a row less its neighbours' mean, for independent rows of variance 1.
_OF_DIFFERENCES = 1.5
_ROW_FLOOR_DN2, _LEAST_ROWS_DN2, _MOST_NATS = 0.002, 0.01, 30.0
# Drops: the band whose energy tells sharpness, and how it is averaged.
_FINE_PX, _COARSE_PX, _AROUND_PX, _PLACE_PX = 0.6, 3.0, 3.0, 4.0
_LEAST_DN2, _NOISE_DN2, _MOST_LOG = 0.6, 0.03, 2.0
_LEAST_SEEN, _BLURRED_LOG = 0.4, 0.5
# Share of an image that is blurred in good sessions; a dot's own blur.
_BLURRED_SHARE, _DOT_PX = 0.003, 1.4
# Deviation of a pair's row offset between sessions.
_ROW_OFFSET_PX = 0.035
# Nats that a finding needs beside the deviations of few sessions; the same of a value whose error is known.
_NEEDED_OF_FEW, _NEEDED_SD = gaussian(NEEDED, FEW), float(np.sqrt(2.0 * NEEDED)) + ONE_SIDED
# The response that two exposures of one place tell, and the drops that any two views tell.
LEAST_RESPONSE = {"log_exponent": LINEAR * (float(np.sqrt(2.0 * _NEEDED_OF_FEW)) + ONE_SIDED)}
LEAST_DROPS = {
    "share": _BLURRED_SHARE * float(np.sqrt(2.0 * _NEEDED_OF_FEW)),
    "sigma_px": _DOT_PX * float(np.sqrt(np.expm1(_BLURRED_LOG))),
}


def beside_columns(
    room: Room, exponent: float, asked: Mapping[str, Effect], reference: Sequence[Room] = ()
) -> list[Found]:
    """Returns the evidence for those effects in `asked` that a room shows in other ways than by columns. exponent: n of
    the lens falloff cos^n. reference: sessions from when the camera was good, of the same or other views."""
    found = {
        "row_noise": lambda effect: _row_noise(effect, room),
        "focus_mismatch": lambda effect: _drops(effect, room, exponent),
        "response_gamma": lambda effect: _response(effect, room),
        "stereo_pitch": lambda effect: _pitch(effect, room, reference),
    }
    each = [of(asked[name]) for name, of in found.items() if name in asked]
    return [evidence for evidence in each if evidence is not None]


def falloff(room: Room, asked: Mapping[str, Effect]) -> Found | None:
    """Returns the evidence for the lens falloff that `calibrate world` measured. Returns None if it measured none, or
    if the effect is not in `asked`."""
    told = room.capture.measured.get("exposure", {}).get("vignetting_exponent")
    if told is None or "vignetting" not in asked:
        return None
    return falloff_of(asked["vignetting"], float(told[0]), float(told[1]))


def falloff_of(effect: Effect, exponent: float, deviation: float) -> Found:
    """Returns the evidence for a lens falloff cos^exponent. deviation: the standard error of the exponent."""
    nats = 0.5 * max(exponent / deviation, 0.0) ** 2
    return Found(effect, nats, {"exponent": (exponent, deviation)}, {"exponent": _NEEDED_SD * deviation})


def _row_noise(effect: Effect, room: Room) -> Found:
    value, deviation = row_variance(room)
    sure = max(deviation, _ROW_FLOOR_DN2)
    nats = min(0.5 * (value / sure) ** 2, _MOST_NATS) if value > _LEAST_ROWS_DN2 else -1.0
    sigma = float(np.sqrt(max(value, 0.0)))
    told = {"row_noise.sigma_dn": (sigma, 0.5 * deviation / max(sigma, 1e-2))}
    return Found(effect, nats, told, {"sigma_dn": float(np.sqrt(max(_LEAST_ROWS_DN2, _NEEDED_SD * sure)))})


def row_variance(room: Room) -> tuple[float, float]:
    """Returns (variance of random row offsets in DN^2, its standard error). It is the covariance between vertical
    strips of one image, minus the covariance between the two images of a view, which the scene causes."""
    found = []
    for left, right in zip(room.images[::2], room.images[1::2], strict=True):
        rows = []  # each image's rows less their neighbours' mean, averaged over strips, [strip][row]
        for whole in (left.whole, right.whole):
            differences = np.clip(whole[1:-1] - 0.5 * (whole[:-2] + whole[2:]), -_MOST_DN, _MOST_DN)
            strips = np.stack([part.mean(axis=1) for part in np.array_split(differences, _STRIPS, axis=1)])
            rows.append(strips - strips.mean(axis=1, keepdims=True))
        within = [(r.sum(axis=0) ** 2 - (r**2).sum(axis=0)) / (_STRIPS * (_STRIPS - 1)) for r in rows]
        found.append(0.5 * sum(within) - rows[0].mean(axis=0) * rows[1].mean(axis=0))
    each = np.concatenate(found) / _OF_DIFFERENCES
    blocks = each[: len(each) // _ROWS * _ROWS].reshape(-1, _ROWS).mean(axis=1)
    return float(blocks.mean()), float(blocks.std() / np.sqrt(len(blocks)))


def _drops(effect: Effect, room: Room, exponent: float) -> Found | None:
    """Returns evidence of drops or dirt on a camera's window, None if it is too small. They stay while the rig turns,
    and the view's other camera sees the same dots sharp. The parameter is the blur averaged over the image, px."""
    maps = zip(*(_sharpness(room, view, exponent) for view in range(room.views)), strict=True)
    blurred = []  # (share of the image, how far its worst place lies below the median sharpness, camera)
    for side, each in zip(SIDES, map(np.stack, maps), strict=True):
        often = np.isfinite(each).sum(axis=0) > 1
        if often.any():
            mildest = np.nanmax(each[:, often], axis=0)
            middle = float(np.median(mildest))
            blurred.append((float((mildest < middle - _BLURRED_LOG).mean()), middle - float(mildest.min()), side))
    share, log_ratio, side = max(blurred, default=(0.0, 0.0, ""))
    nats = student(min(0.5 * (share / _BLURRED_SHARE) ** 2, _MOST_NATS), FEW)
    if nats < NEEDED:
        return None
    here = _DOT_PX * float(np.sqrt(np.expm1(log_ratio)))
    mean = (1.0 if side == "right" else -1.0) * share * here
    place = f"The {side} camera is blurred in places, {100 * share:.0f} % of its image, by {here:.1f} px"
    said = f"{place}: drops or dirt on its window"
    return Found(effect, nats, {"focus_mismatch.sigma_px": (mean, 0.3 * abs(mean))}, finding=said)


def _sharpness(room: Room, view: int, exponent: float) -> tuple[Image, Image]:
    """Returns a sharpness map [height][width] for each camera (left, right): the log ratio of its high-frequency energy
    to the other camera's at the same surface point. NaN = unknown. Lens falloff is corrected, because the cameras see a
    point at different angles."""
    images, places = room.images[2 * view : 2 * view + 2], room.places(2 * view, 2 * view + 1)
    energy = [blur((blur(i.dn, _FINE_PX) - blur(i.dn, _COARSE_PX)) ** 2, _AROUND_PX) for i in images]
    other = places.read(energy[1])
    known = places.seen & (energy[0] + other > _LEAST_DN2)
    lens = [np.float32(-exponent) * np.log1p(image.r2()) for image in images]
    ratio = np.log((energy[0] + _NOISE_DN2) / (other + _NOISE_DN2)) - lens[0] + places.read(lens[1])
    middle = np.median(ratio[known]) if known.any() else 0.0
    ratio = np.clip(ratio - middle, -_MOST_LOG, _MOST_LOG)[known]
    there = np.rint(places.row[known]).astype(int), np.rint(places.column[known]).astype(int)
    return _spread(room, np.nonzero(known), ratio), _spread(room, there, -ratio)


def _spread(room: Room, at: tuple[NDArray[np.int64], ...], value: Image) -> Image:
    """Returns the local mean of values at pixels (row, column), [height][width]; NaN far from all of them."""
    total, count = np.zeros(room.shape, np.float32), np.zeros(room.shape, np.float32)
    np.add.at(total, at, value)
    np.add.at(count, at, 1.0)
    near = blur(count, _PLACE_PX)
    return np.where(near > _LEAST_SEEN, blur(total, _PLACE_PX) / np.maximum(near, 1e-3), np.nan).astype(np.float32)


def _response(effect: Effect, room: Room) -> Found | None:
    """Returns the evidence for a bent response from two exposures of one view; None without them."""
    value = room.capture.measured.get("exposure", {}).get("response_log_exponent")
    said = "Two exposures of one place differ by another factor than their times: the response is no line"
    return None if value is None else _measured(effect, value, LINEAR, LEAST_RESPONSE, said)


def _pitch(effect: Effect, room: Room, reference: Sequence[Room]) -> Found | None:
    """Returns the evidence for a row offset between the cameras that good sessions lack; None without such sessions.
    The offsets come from the rigs that `calibrate world` measured."""
    if not reference:
        return None
    own, *good = (float(r.capture.rig.right.K[1, 2] - r.capture.rig.left.K[1, 2]) for r in (room, *reference))
    f = room.capture.rig.left.K[0, 0]
    return _measured(effect, (own - float(np.mean(good))) / f, _ROW_OFFSET_PX / f)


def _measured(
    effect: Effect, value: float, deviation: float, least: Mapping[str, float] | None = None, said: str = ""
) -> Found:
    """Returns the evidence that the first parameter of an effect is not 0. value: as `calibrate world` measured it.
    deviation: standard deviation among good units. least: as in Found. said: the finding."""
    p = effect.parameters[0]
    whole = deviation**2 + (2.0 * p.typical) ** 2
    nats = 0.5 * value**2 * (deviation**-2 - 1.0 / whole) - 0.5 * np.log(whole / deviation**2)
    return Found(effect, student(float(nats), FEW), {f"{effect.id}.{p.name}": (value, deviation)}, least or {}, said)
