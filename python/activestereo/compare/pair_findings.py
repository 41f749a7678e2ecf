# SPDX-License-Identifier: Apache-2.0
"""Measures faults of a rectified infrared pair without a scene: saturation, gain and offset between the cameras, row
offset, and f x baseline against the device's own depth; and statistics of its dots and noise. Intervals are 95 %, from
a bootstrap over blocks of the image: pixels are not independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_gradient_magnitude, map_coordinates, maximum_filter

from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.where import interval

_BLOCK_PX = 48
_DRAWS = 400
_SEED = 3
_ROW_STEP_PX = 0.5
_SMOOTH_PX = 2.0
# Larger differences between the device's and our own disparity are mismatches of one of them.
_LARGEST_MISMATCH_PX = 1.0
_LEAST_PIXELS = 500


@dataclass(frozen=True)
class Finding:
    """A measured figure of a pair. text: its name in words; value with its 95 % interval (low, high), in unit; neutral:
    the value of a perfect pair."""

    name: str
    text: str
    value: float
    low: float
    high: float
    unit: str
    neutral: float

    @property
    def stands_out(self) -> bool:
        return not self.low <= self.neutral <= self.high

    def as_json(self) -> dict[str, Any]:
        return vars(self) | {"stands_out": self.stands_out}


def pair_findings(
    left: np.ndarray, right: np.ndarray, disparity: np.ndarray, max_dn: float,
    device_disparity: np.ndarray | None = None,
) -> list[Finding]:  # fmt: skip
    """Measures a pair's Findings. left, right: DN [height][width]; disparity: matched, at the left image's pixels, 0 =
    none; device_disparity: the device's own at the same pixels, at its nominal f x baseline, 0 = none. Raises
    ValueError if too little of the image is matched."""
    left, right = np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)
    blocks = Blocks(left.shape)
    # 1. Saturation.
    found, everywhere = [], np.ones(left.shape, bool)
    for side, image in (("left", left), ("right", right)):
        share = blocks.sums(image >= max_dn, everywhere) / blocks.sums(everywhere, everywhere)
        found.append(_finding(f"saturated_{side}", f"pixels of the {side} image at full scale", share, "1"))
    v, u = np.mgrid[0 : left.shape[0], 0 : left.shape[1]].astype(np.float64)
    seen = (disparity > 0) & (u - disparity >= 1)
    if seen.sum() < _LEAST_PIXELS:
        raise ValueError(f"only {int(seen.sum())} pixels of the pair are matched; {_LEAST_PIXELS} are needed")
    # 2. Right = gain x left + offset, by orthogonal regression of smoothed images: both are equally noisy.
    there = map_coordinates(right, [v, u - disparity], order=1, mode="nearest")
    mask = seen & (left < max_dn - 1) & (there < max_dn - 1)
    weight = gaussian_filter(mask.astype(np.float64), _SMOOTH_PX)
    a, b = (
        gaussian_filter(np.where(mask, image, 0.0), _SMOOTH_PX) / np.maximum(weight, 1e-6) for image in (left, there)
    )
    inside = mask & (weight > 0.6)
    n = np.maximum(blocks.sums(1.0, inside), 1.0)
    mean_a, mean_b = blocks.sums(a, inside) / n, blocks.sums(b, inside) / n
    aa, bb = blocks.sums(a * a, inside) / n - mean_a**2, blocks.sums(b * b, inside) / n - mean_b**2
    ab = blocks.sums(a * b, inside) / n - mean_a * mean_b
    slope = (bb - aa + np.sqrt((bb - aa) ** 2 + 4 * ab**2)) / (2 * np.where(ab != 0, ab, 1e-12))
    found += [
        _finding("gain_ratio", "gain of the right camera over the left", slope, "1", 1.0),
        _finding("offset_dn", "offset of the right camera at that gain", mean_b - slope * mean_a, "DN"),
    ]
    # 3. The row offset of the right image, and its change from top to bottom and from left to right: least squares on
    # the derivative along columns, Lucas and Kanade's step once.
    mask = seen & (left < max_dn - 1)
    there = map_coordinates(right, [v, u - disparity], order=3, mode="nearest")
    above, below = (
        map_coordinates(right, [v + s * _ROW_STEP_PX, u - disparity], order=3, mode="nearest") for s in (-1, 1)
    )
    row_slope = (below - above) / (2 * _ROW_STEP_PX)
    # Remove slow parts, so that different gain and offset of the cameras are not taken for a shift.
    smooth = lambda image: gaussian_filter(image, 4 * _SMOOTH_PX)  # noqa: E731
    rest = (left - smooth(left)) - (there - smooth(there))
    x, y = 2 * u / (u.shape[1] - 1) - 1, 2 * v / (v.shape[0] - 1) - 1
    columns = [row_slope, row_slope * x, row_slope * y]
    gram = np.stack([[blocks.sums(a * b, mask) for b in columns] for a in columns]).transpose(2, 0, 1)
    moment = np.stack([blocks.sums(a * rest, mask) for a in columns], axis=1)
    solution = np.linalg.solve(gram + 1e-9 * np.eye(3), moment[..., None])[..., 0]
    found += [
        _finding("row_offset_px", "rows of the right image lie lower by", solution[:, 0], "px"),
        _finding("row_offset_across_px", "further at the right border (roll) by", 2 * solution[:, 1], "px"),
        _finding("row_offset_down_px", "further at the bottom (pitch, focal) by", 2 * solution[:, 2], "px"),
    ]
    if device_disparity is None:
        return found
    # 4. Own disparity = (1 + scale) x the device's + offset: with one of the two, and with both.
    device = np.asarray(device_disparity)
    both = (disparity > 0) & (device > 0)
    apart = disparity - device
    both &= np.abs(apart - np.median(apart[both]) if both.any() else 0.0) < _LARGEST_MISMATCH_PX
    n, d, r = blocks.sums(1.0, both), blocks.sums(device, both), blocks.sums(apart, both)
    dd, dr = blocks.sums(device**2, both), blocks.sums(device * apart, both)
    determinant = np.maximum(n * dd - d * d, 1e-12)
    scale, offset = dr / np.maximum(dd, 1e-12), r / np.maximum(n, 1.0)
    beside = (n * dr - d * r) / determinant
    return found + [
        _finding("focal_baseline_error", "f x baseline larger than given, alone, by", scale, "1"),
        _finding("disparity_offset_px", "or disparity larger than given, alone, by", offset, "px"),
        _finding("focal_baseline_error_beside_offset", "or f x baseline, with an offset, by", beside, "1"),
        _finding("offset_beside_scale_px", "and that offset", (dd * r - d * dr) / determinant, "px"),
    ]


class Blocks:
    """Divides an image into square blocks and draws bootstrap weights for them, [draws + 1][blocks]; the first row is
    the image itself."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        rows, columns = np.arange(shape[0]) // _BLOCK_PX, np.arange(shape[1]) // _BLOCK_PX
        self._index = (rows[:, None] * (columns[-1] + 1) + columns[None]).ravel()
        self._count = int(self._index.max()) + 1
        rng = np.random.Generator(np.random.Philox(_SEED))
        self._weights = np.vstack([np.ones(self._count), rng.poisson(1.0, (_DRAWS, self._count))])

    def sums(self, values: np.ndarray | float, mask: np.ndarray) -> np.ndarray:
        """Returns the sum of an image's values, or of a number, over a mask for each bootstrap draw, [draws + 1]."""
        of_block = np.bincount(self._index, np.where(mask, values, 0.0).ravel(), minlength=self._count)
        return self._weights @ of_block


def _finding(name: str, text: str, draws: np.ndarray, unit: str, neutral: float = 0.0) -> Finding:
    low, high = interval(draws[1:])
    return Finding(name, text, float(draws[0]), float(low), float(high), unit, neutral)


def findings_text(findings: Sequence[Finding]) -> str:
    """Returns a line of at most 80 columns for each finding, with its 95 % interval."""
    lines = []
    for f in findings:
        scale, unit = (100.0, "%") if f.unit == "1" and f.neutral == 0.0 else (1.0, "" if f.unit == "1" else f.unit)
        value, low, high = (scale * x for x in (f.value, f.low, f.high))
        mark = " " if f.stands_out else "*"
        lines.append(f"{f.text + ':':42}{value:9.3g}{mark}{unit:3}({low:.3g} to {high:.3g})")
    if not all(f.stands_out for f in findings):
        lines.append("* a perfect pair may show this, too")
    return "\n".join(lines)


BLUR_PX = 4.0
# Least height of a dot's peak above its surroundings, in standard deviations of the noise.
_PEAK = 5.0
_LEVELS_DN = (20.0, 40.0)
_SMOOTHEST = 0.25
_DARKEST = 1e-3
_WARP_NOISE = 0.75  # share of white noise that cubic interpolation keeps on average over all fractions of a pixel

Image = NDArray[np.float64]


def residual_image(left: Image, right: Image, disparity: NDArray[np.floating]) -> tuple[Image, NDArray[np.bool_]]:
    """Subtracts the right image, read at the disparity, from the left one. Returns (the difference, high-pass filtered,
    DN; a mask of the pixels that both cameras see)."""
    v, u = np.mgrid[0 : left.shape[0], 0 : left.shape[1]].astype(np.float64)
    seen = (disparity > 0) & (u - disparity >= 1)
    there = map_coordinates(right, [v, u - disparity], order=3, mode="nearest")
    rest = np.where(seen, left - there, 0.0)
    weight = gaussian_filter(seen.astype(np.float64), BLUR_PX)
    return np.where(seen, rest - gaussian_filter(rest, BLUR_PX) / np.maximum(weight, 1e-6), 0.0), seen


def pair_statistics(left: Image, right: Image, disparity: NDArray[np.floating], max_dn: float) -> list[Finding]:
    """Measures statistics of dots and noise in one rectified pair, DN [height][width], for comparison with a simulated
    pair. disparity: matched, 0 = none.

        dot RMS      of the left image less its Gaussian blur of 4 px
        residual     the same of left less right at the matched disparity, over sqrt 2, as a share of the dot RMS
        noise        half of the variance of left less right in smooth parts: speckle and disparity errors are in it
        black level  the darkest thousandth of both images: an upper bound
    """
    left, right = np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)
    blocks, inside = Blocks(left.shape), left < max_dn - 1
    rest, seen = residual_image(left, right, disparity)
    sharp = left - gaussian_filter(left, BLUR_PX)
    both = seen & inside & (right < max_dn - 1)
    dots = blocks.sums(sharp**2, both)
    count = np.maximum(blocks.sums(1.0, both), 1.0)
    slope = gaussian_gradient_magnitude(left, 1.0)
    is_smooth = slope <= np.quantile(slope, _SMOOTHEST)
    chosen = rest[both & is_smooth] ** 2 / (1.0 + _WARP_NOISE)  # variance of one camera
    noise_dn2 = np.maximum(chosen, ROUNDING_VARIANCE) if chosen.size else np.array([ROUNDING_VARIANCE])
    peaks = (sharp == maximum_filter(sharp, 3)) & (sharp > _PEAK * np.sqrt(np.median(noise_dn2))) & inside
    everywhere = np.ones(left.shape, bool)
    area, density = blocks.sums(1.0, everywhere), blocks.sums(1e3 * peaks, everywhere)
    height = blocks.sums(sharp, peaks) / np.maximum(blocks.sums(1.0, peaks), 1.0)
    left_over = np.sqrt(blocks.sums(rest**2, both) / 2.0 / np.maximum(dots, 1e-9))
    out = [
        _finding("background_dn", "median of the left image", np.full(len(area), np.median(left)), "DN"),
        _finding("dots_per_1000_px", "peaks of dots in 1000 pixels", density / area, ""),
        _finding("dot_peak_dn", "mean height of a dot", height, "DN"),
        _finding("dot_rms_dn", "RMS of dots and texture, left", np.sqrt(dots / count), "DN"),
        _finding("residual_share", "left less right, over that RMS", left_over, "1"),
    ]
    level = gaussian_filter(left, 1.0)
    chosen = both & (level > _LEVELS_DN[0]) & (level < _LEVELS_DN[1]) & is_smooth
    if chosen.sum() > 200:
        variance = blocks.sums(rest**2, chosen) / np.maximum(blocks.sums(1.0, chosen), 1.0) / (1.0 + _WARP_NOISE)
        out.append(_finding("noise_20_40_dn", "noise at 20 to 40 DN, at most", np.sqrt(variance), "DN"))
    darkest = float(np.quantile(np.concatenate([left.ravel(), right.ravel()]), _DARKEST))
    out.append(_finding("black_dn", "black level, at most", np.full(len(area), darkest), "DN"))
    return out


def statistics_text(columns: dict[str, list[Finding]]) -> str:
    """Returns a text table with a row for each figure and a column for each pair. columns: {column's name: its
    Findings}."""
    lines = [f"{'':32}" + "".join(f"{name:>24}" for name in columns)]
    for shown in {f.name: f for findings in columns.values() for f in findings}.values():
        (scale, unit), line = (100.0, "%") if shown.unit == "1" else (1.0, shown.unit), f"{shown.text + ':':32}"
        for findings in columns.values():
            found = next((f for f in findings if f.name == shown.name), None)
            text = "-" if found is None else f"{scale * found.value:.3g} {unit}"
            if found is not None and found.high > found.low:
                text += f" ({scale * found.low:.3g}-{scale * found.high:.3g})"
            line += f"{text:>24}"
        lines.append(line)
    return "\n".join(lines)
