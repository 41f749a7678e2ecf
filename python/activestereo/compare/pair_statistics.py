# SPDX-License-Identifier: Apache-2.0
"""Statistics of dots and noise in one rectified infrared pair: figures to lay beside those of a simulated pair of the
same view. Intervals are 95 %, from the same bootstrap over blocks of the image as pair_findings.

    dot RMS      of the left image less its Gaussian blur of 4 px
    residual     the same of left less right at the matched disparity, over sqrt 2, as a share of the dot RMS
    noise        half of the variance of left less right where the image is smooth, by level: an upper bound, for
                 speckle and errors of the disparity are in it
    black level  the darkest thousandth of both images: an upper bound, too
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_gradient_magnitude, map_coordinates, maximum_filter

from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.bootstrap import interval
from activestereo.compare.pair_findings import Blocks, Finding

BLUR_PX = 4.0
# A dot's peak stands so many standard deviations of the noise above its surroundings.
_PEAK = 5.0
_LEVELS_DN = (20.0, 40.0)
_SMOOTHEST = 0.25
_DARKEST = 1e-3
_WARP_NOISE = 0.75  # share of white noise that cubic interpolation keeps on average over all fractions of a pixel

Image = NDArray[np.float64]


def residual_image(left: Image, right: Image, disparity: NDArray[np.floating]) -> tuple[Image, NDArray[np.bool_]]:
    """(left less right at the disparity, both without their blur, DN; where both cameras see the place)."""
    v, u = np.mgrid[0 : left.shape[0], 0 : left.shape[1]].astype(np.float64)
    seen = (disparity > 0) & (u - disparity >= 1)
    there = map_coordinates(right, [v, u - disparity], order=3, mode="nearest")
    rest = np.where(seen, left - there, 0.0)
    weight = gaussian_filter(seen.astype(np.float64), BLUR_PX)
    return np.where(seen, rest - gaussian_filter(rest, BLUR_PX) / np.maximum(weight, 1e-6), 0.0), seen


def pair_statistics(left: Image, right: Image, disparity: NDArray[np.floating], max_dn: float) -> list[Finding]:
    """Findings of a pair, DN [height][width]; disparity: matched, 0 = none."""
    left, right = np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)
    blocks, inside = Blocks(left.shape), left < max_dn - 1
    rest, seen = residual_image(left, right, disparity)
    sharp = left - gaussian_filter(left, BLUR_PX)
    both = seen & inside & (right < max_dn - 1)
    dots = blocks.sums(sharp**2, both)
    count = np.maximum(blocks.sums(np.ones(left.shape), both), 1.0)
    noise_dn2 = _smooth_variance(left, rest, both)
    peaks = (sharp == maximum_filter(sharp, 3)) & (sharp > _PEAK * np.sqrt(np.median(noise_dn2))) & inside
    everywhere = np.ones(left.shape, bool)
    area = blocks.sums(np.ones(left.shape), everywhere)
    height = blocks.sums(sharp, peaks) / np.maximum(blocks.sums(np.ones(left.shape), peaks), 1.0)
    out = [
        _finding("background_dn", "median of the left image", np.full(len(area), np.median(left)), "DN"),
        _finding(
            "dots_per_1000_px",
            "peaks of dots in 1000 pixels",
            1e3 * blocks.sums(peaks.astype(float), everywhere) / area,
            "",
        ),
        _finding("dot_peak_dn", "mean height of a dot", height, "DN"),
        _finding("dot_rms_dn", "RMS of dots and texture, left", np.sqrt(dots / count), "DN"),
        _finding(
            "residual_share",
            "left less right, over that RMS",
            np.sqrt(blocks.sums(rest**2, both) / 2.0 / np.maximum(dots, 1e-9)),
            "1",
        ),
    ]
    level = gaussian_filter(left, 1.0)
    chosen = both & (level > _LEVELS_DN[0]) & (level < _LEVELS_DN[1]) & _smooth(left)
    if chosen.sum() > 200:
        variance = blocks.sums(rest**2, chosen) / np.maximum(blocks.sums(np.ones(left.shape), chosen), 1.0)
        out.append(
            _finding("noise_20_40_dn", "noise at 20 to 40 DN, at most", np.sqrt(variance / (1.0 + _WARP_NOISE)), "DN")
        )
    darkest = float(np.quantile(np.concatenate([left.ravel(), right.ravel()]), _DARKEST))
    out.append(_finding("black_dn", "black level, at most", np.full(len(area), darkest), "DN"))
    return out


def statistics_text(columns: dict[str, list[Finding]]) -> str:
    """A table: one row for each figure, one column for each pair."""
    names = {f.name: f for findings in columns.values() for f in findings}
    head = f"{'':32}" + "".join(f"{name:>24}" for name in columns)
    return "\n".join([head, *(_row(f, columns) for f in names.values())])


def _row(shown: Finding, columns: dict[str, list[Finding]]) -> str:
    scale, unit = (100.0, "%") if shown.unit == "1" else (1.0, shown.unit)
    cells = []
    for findings in columns.values():
        found = next((f for f in findings if f.name == shown.name), None)
        text = "-" if found is None else f"{scale * found.value:.3g} {unit}"
        if found is not None and found.high > found.low:
            text += f" ({scale * found.low:.3g}-{scale * found.high:.3g})"
        cells.append(f"{text:>24}")
    return f"{shown.text + ':':32}" + "".join(cells)


def _finding(name: str, text: str, draws: NDArray[np.float64], unit: str) -> Finding:
    low, high = interval(draws[1:])
    return Finding(name, text, float(draws[0]), float(low), float(high), unit, 0.0)


def _smooth(image: Image) -> NDArray[np.bool_]:
    slope = gaussian_gradient_magnitude(image, 1.0)
    return np.asarray(slope <= np.quantile(slope, _SMOOTHEST))


def _smooth_variance(left: Image, rest: Image, both: NDArray[np.bool_]) -> NDArray[np.float64]:
    """One camera's squared differences where the image is smooth; never empty."""
    chosen = rest[both & _smooth(left)] ** 2 / (1.0 + _WARP_NOISE)
    return np.maximum(chosen, ROUNDING_VARIANCE) if chosen.size else np.array([ROUNDING_VARIANCE])
