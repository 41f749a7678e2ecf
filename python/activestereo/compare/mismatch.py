# SPDX-License-Identifier: Apache-2.0
"""Checks whether a capture's images match its pattern and its geometry (scene and rig), in which effects take no part,
and whether its frames, repeats and depth are as stated.

If the geometry is right, both cameras see the same dots at the scene's depth, under any pattern. If the pattern is
right, too, the rendered dots match the measured ones. Both checks correlate high-pass filtered images, at shifts of a
few pixels: calibration errors may displace dots, never exchange them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from activestereo.capture.capture import SIDES, Frame
from activestereo.capture.images import block_means
from activestereo.common.computed_once import computed_once
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.common.shown import listed
from activestereo.compare.image_errors import ImageErrors
from activestereo.compare.measured_image import warp_between
from activestereo.compare.nuisances import Fit

_FRAMES = 3  # number of frames that are checked
_SLOW_PX = 3.0
# Largest shift of dots, as a share of the median disparity; it is at least 1 pixel and at most _MOST_SHIFT_PX.
_SHIFT_SHARE = 0.12
_MOST_SHIFT_PX = 4
# Least correlation of a match, as a share of the largest that noise allows. Another pattern gives 0.05 at most; dots
# moved, blurred and dimmed by the library's strongest effects keep more than 0.4.
_LEAST = 0.25
# Below this share of the largest correlation a warning says that the pattern explains little.
_MUCH = 0.75
_LEAST_DOTS = 1.0  # variance of the dots over the noise's, below which nothing is concluded
# Repeats of this many times the squared error of the best of them, above 1 DN^2, show no single view.
_FOREIGN = 2.0
# Repeats that lie further apart, in pixels, or differ in a block's mean by more standard errors, are none. Nine
# captures' repeats lie 0.007 px apart at most and differ by 4; grains of two pixels make that 8.
_MOVED_PX, _BLOCK_PX, _CHANGED_SIGMA = 0.1, 16, 20.0
# Frames that differ by less than this factor, or as light^0.6 to light^2.7 does at another exposure, have the exposures
# that are stated. Nine captures' frames differ by 1.07, and by 1.22 at half the exposure under light^0.75.
_BRIGHTER, _BENDS = 1.4, np.array([-0.4, 1.7])
_FULL = 0.5  # share of a camera's pixels at full scale beyond which a frame shows nothing
_OTHER_UNIT = 2.0  # factor of the device's depth that no fault of a camera makes

Image = NDArray[np.generic]


@dataclass(frozen=True)
class Match:
    """Holds correlations of dot images, -1..1. pattern: rendered with measured dots. geometry: left with right measured
    image at the scene's depth. swapped: the same with the cameras exchanged. possible: the largest correlation that
    noise allows. frames: ids of the frames used. All correlations are None if no frame shows dots, and 0 if the cameras
    see no surface of the scene in common."""

    pattern: float | None
    geometry: float | None
    swapped: float | None
    possible: float | None
    frames: tuple[int, ...]

    @property
    def has_wrong_geometry(self) -> bool:
        """Returns whether the geometry is another one than stated, which no effect explains."""
        return self.geometry is not None and self.possible is not None and self.geometry < _LEAST * self.possible

    @property
    def warnings(self) -> list[str]:
        """Returns one line for each fault of pattern or geometry; none if both are right or nothing is known."""
        if self.pattern is None or self.geometry is None or self.possible is None or self.swapped is None:
            return []
        limit = _LEAST * self.possible
        if self.geometry == 0.0:
            return [
                "the scene is not where the cameras look: no surface of it is seen by both of them: check "
                "camera_to_world, and the scene's place and units; no effect explains this"
            ]
        if self.has_wrong_geometry and self.swapped > max(limit, self.geometry):
            return [
                f"the cameras are exchanged: at the scene's depth the images correlate {self.swapped:.2f} with left "
                f"and right exchanged and {self.geometry:.2f} as they are: exchange left/ and right/ in the capture"
            ]
        if self.has_wrong_geometry:
            return [
                f"geometry does not match: at the scene's depth the cameras' dots correlate {self.geometry:.2f} (noise "
                f"alone would leave {self.possible:.2f}) and the rendered dots {self.pattern:.2f}: check "
                "camera_to_world, the scene's place and units, K and the baseline; no effect explains this"
            ]
        if self.pattern < limit:
            return [
                f"the pattern does not match: the rendered dots correlate {self.pattern:.2f} with the measured ones, "
                f"the cameras' own dots {self.geometry:.2f} with each other at the scene's depth: check pattern.png "
                "and the projector's K and pose, or measure them by 'activestereo calibrate pattern'; no effect "
                "explains this"
            ]
        if self.pattern < _MUCH * self.possible:
            told = f"the rendered dots correlate {self.pattern:.2f} with the measured ones, of {self.possible:.2f}"
            advice = "measure it by 'activestereo calibrate pattern' or 'calibrate dots'"
            if self.geometry < _MUCH * self.possible:
                told += f", and the cameras' own dots {self.geometry:.2f} at the scene's depth, of as much"
                advice = f"check camera_to_world and the rig first, then {advice}"
            return [
                f"the pattern explains little: {told} that noise would leave: {advice}; what an effect is found to "
                "explain may be the pattern's"
            ]
        return []


@computed_once
def match_of(errors: ImageErrors) -> Match:
    """Computes the Match from at most three train frames at rest with the projector on."""
    frames = [f for f in errors.capture.split("train") if f.projector_power > 0 and not f.is_moving]
    frames = frames[:: max(1, len(frames) // _FRAMES)][:_FRAMES]
    rows = [row for f in frames if (row := _one(f, errors)) is not None]
    if not rows:
        return Match(None, None, None, None, ())
    pattern, geometry, swapped, possible = (float(x) for x in np.mean([row[1:] for row in rows], axis=0))
    return Match(pattern, geometry, swapped, possible, tuple(int(row[0]) for row in rows))


def _one(frame: Frame, errors: ImageErrors) -> tuple[float, ...] | None:
    """Computes (frame id, pattern, geometry, swapped, possible) of one frame, as in Match; None if it shows no dots."""
    views, measured, keys = errors.views, errors.measured, ((frame.id, "left"), (frame.id, "right"))
    left, right = (_fast(measured[key]) for key in keys)
    warp = warp_between(views[keys[0]], views[keys[1]])
    inside = warp.seen & _unclipped(errors, frame)
    if not warp.seen.any():
        return frame.id, 0.0, 0.0, 0.0, 1.0
    if inside.sum() < 1000:
        return None
    dots = _dots_variance(errors, frame, left[inside])
    if dots is None:
        return None
    possible = dots / left[inside].var()
    columns = np.arange(inside.shape[1])[None, :]
    disparity = float(np.median(np.abs(columns - warp.u)[inside]))
    reach = int(np.clip(round(_SHIFT_SHARE * disparity), 1, _MOST_SHIFT_PX))
    # The best correlations over shifts: of the rendered dots in both directions, of the other camera's along rows.
    shifts, rendered = range(-reach, reach + 1), _fast(errors.layers[frame.id]["left"].projector)
    pattern = max(_correlation(left[inside], np.roll(rendered, (v, u), (0, 1))[inside]) for v in shifts for u in shifts)
    geometry, swapped = (
        max(_correlation(a[inside], warp.read(b, shift)[inside]) for shift in shifts)
        for a, b in ((left, right), (right, left))
    )
    return frame.id, pattern, geometry, swapped, possible


def _unclipped(errors: ImageErrors, frame: Frame) -> NDArray[np.bool_]:
    """Returns which pixels of a frame's left image are below full scale and show the known scene, [height, width]."""
    view, measured = errors.views[frame.id, "left"], errors.measured[frame.id, "left"]
    return (np.asarray(measured, np.float64) < view.max_dn - 1) & view.known_mask()


def _dots_variance(errors: ImageErrors, frame: Frame, fast: NDArray[np.float64]) -> float | None:
    """Returns the variance of a frame's left dots above noise, DN^2; None if it is less than _LEAST_DOTS. fast: pixels
    after _fast()."""
    model, measured = errors.noise_model, np.asarray(errors.measured[frame.id, "left"])
    noise = 0.0 if model is None else model.mean_variance(measured, frame.gain)
    dots = float(fast.var()) - noise
    return None if dots < _LEAST_DOTS * max(noise, ROUNDING_VARIANCE) else dots


def _correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0 else 0.0


def _fast(image: Image) -> NDArray[np.float64]:
    """Returns the image after a high-pass filter, which removes slow changes by room light, falloff and albedo."""
    value = np.asarray(image, np.float64)
    return value - gaussian_filter(value, _SLOW_PX)


def _moved(first: Image, other: Image) -> tuple[float, float]:
    """Returns (distance between two repeats to first order, px; largest change of a block's mean, standard errors).
    Each row's common factor is taken out: lamps flicker by rows, and the laser's power varies."""
    one, two = (np.asarray(image, np.float64) for image in (first, other))
    mean, rest = 0.5 * (one + two), two - one
    rest -= mean * ((rest * mean).sum(axis=1) / np.maximum((mean**2).sum(axis=1), 1e-12))[:, None]
    slopes = np.stack(np.gradient(mean), axis=-1).reshape(-1, 2)
    shift = np.linalg.lstsq(slopes, rest.ravel(), rcond=None)[0]
    change = block_means(rest, _BLOCK_PX)
    variance = np.maximum(block_means(rest**2, _BLOCK_PX) - change**2, ROUNDING_VARIANCE)
    return float(np.hypot(*shift)), float(np.abs(change / np.sqrt(variance)).max(initial=0.0) * _BLOCK_PX)


def scale_warnings(fit: Fit) -> list[str]:
    """Returns the warnings of scales that the fit set to 0, one line each."""
    words = {
        "projector_scale": "the projector's scale is at its bound, 0: the measured images show none of its light where "
        "it is rendered",
        "ambient_scale": "the ambient scale is at its bound, 0: the images are darker where the rendered room light is "
        "brighter; "
        "albedos or the scene's lights are wrong, or the capture has no room light",
    }
    return [words[name] for name in fit.at_bound]


def _exposure_warnings(errors: ImageErrors) -> list[str]:
    """Returns a warning of the still frames whose dots and level are both another multiple of the model's than those of
    the frame that is nearest in exposure, among those with the usual multiple. A response may be bent. Frames of one
    projector power are compared."""
    said, still = [], [f for f in errors.capture.frames if f.projector_power > 0 and not f.is_moving]
    for power in sorted({f.projector_power for f in still}):
        rows = [row for f in still if f.projector_power == power and (row := _multiples(errors, f)) is not None]
        found = _brighter(rows)
        if found:
            told = f"its dots are {np.median(list(found.values())):.2g} times as bright as its exposure_s and gain say"
            remedy = "beside the other frames: correct these, or leave it out"
            said.append(f"frame {listed([*map(str, sorted(found))])}: {told}, {remedy}")
    return said


def _multiples(errors: ImageErrors, frame: Frame) -> tuple[float, float, Frame] | None:
    """Returns (the measured dots' amplitude over the model's, the same of the mean level, the frame); None if it shows
    no dots."""
    key, inside = (frame.id, "left"), _unclipped(errors, frame)
    images = [np.asarray(x[key], np.float64) for x in (errors.measured, errors.predictions)]
    if not inside.any():
        return None
    measured, expected = (_fast(image)[inside] for image in images)
    dots, due = _dots_variance(errors, frame, measured), expected.var()
    if dots is None or due <= 0.0:
        return None
    level, due_level = (float((image[inside] - errors.fit.nuisances.black_dn).mean()) for image in images)
    return float(np.sqrt(dots / due)), max(level, 0.0) / max(due_level, 1e-9), frame


def _brighter(rows: Sequence[tuple[float, float, Frame]]) -> dict[int, float]:
    """Returns {frame id: multiple of its dots} of frames that differ from what is stated. rows: of _multiples()."""
    middle = float(np.median([dots for dots, *_ in rows])) if rows else 1.0
    alike = [row for row in rows if 1.0 / _BRIGHTER < row[0] / middle < _BRIGHTER]
    alike.sort(key=lambda row: abs(np.log(row[0] / middle)))
    found: dict[int, float] = {}
    for dots, level, frame in rows if alike else ():
        near = min(alike, key=lambda row: abs(np.log(frame.exposure_gain / row[2].exposure_gain)))
        bends = _BENDS * np.log(frame.exposure_gain / near[2].exposure_gain)
        ratios = dots / near[0], level / max(near[1], 1e-9)
        if min(ratios) > _BRIGHTER * np.exp(max(bends)) or max(ratios) < np.exp(min(bends)) / _BRIGHTER:
            found[frame.id] = ratios[0]
    return found


def recording_warnings(errors: ImageErrors) -> list[str]:
    """Returns the warnings of a mismatch, of frames at full scale, of repeats that are none, and of depth in another
    unit, one line each."""
    match, capture, most = match_of(errors), errors.capture, errors.capture.rig.max_dn
    said = match.warnings
    full = [f.id for f in capture.frames if max(np.mean(errors.measured[f.id, s] >= most) for s in SIDES) > _FULL]
    if full:
        share = f"more than {100 * _FULL:.0f} % of its pixels are at full scale, {most} DN"
        said.append(f"frame {listed([*map(str, full)])}: {share}: leave it out of capture.json")
    scores = {frame["id"]: frame for frame in errors.by_frame()}
    for frames in (own for own in capture.repeats() if not {frame.id for frame in own} & set(full)):
        noise, least = scores[frames[0].id]["noise_floor_dn"], min(scores[frame.id]["rmse_dn"] for frame in frames)
        pairs = [[errors.measured[f.id, side] for f in (frames[0], other)] for other in frames[1:] for side in SIDES]
        moved, changed = np.max([_moved(*pair) for pair in pairs], axis=0)
        if noise is not None and noise**2 > _FOREIGN * least**2 + 1.0:
            told = f"vary by {noise:.1f} DN, but one of them differs from the model by {least:.1f} DN alone"
        elif moved > _MOVED_PX:
            told = f"lie {moved:.2g} px apart"
        elif changed > _CHANGED_SIGMA:
            told = f"differ in a place of {_BLOCK_PX}x{_BLOCK_PX} pixels by {changed:.0f} times their noise"
        else:
            continue
        remedy = "they show no still view in steady light: set their repeat_group to null"
        said.append(f"the frames of repeat_group {frames[0].repeat_group} {told}: {remedy}")
    if not (match.has_wrong_geometry or capture.uncertainty.exposure):  # which is a light's, or fitted
        said += _exposure_warnings(errors)
    ratios = [np.empty(0)]
    for frame in capture.frames:
        if (depth_m := capture.depth(frame)) is not None:
            true_m = errors.views[frame.id, "left"].depth_m
            both = (depth_m > 0) & (true_m > 0)
            ratios.append(depth_m[both] / true_m[both])
    every = np.concatenate(ratios)
    ratio = float(np.median(every)) if every.size and not match.has_wrong_geometry else 1.0
    if not 1.0 / _OTHER_UNIT < ratio < _OTHER_UNIT:
        told = f"the device's depth is {ratio:.4g} times the scene's in the median"
        said.append(f"{told}: correct depth_scale, the metres per unit of its images")
    return said
