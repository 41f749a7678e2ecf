# SPDX-License-Identifier: Apache-2.0
"""Measures faults of a rectified infrared pair without a scene: saturation, gain and offset between the cameras, row
offset, and f x baseline against the device's own depth. Intervals are 95 %, from a bootstrap over blocks of the image:
pixels are not independent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from activestereo.capture.images import block_numbers
from activestereo.compare.where import BlockBootstrap, interval

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
    """A measured figure of a pair. text: its description; value: with its 95 % interval (low, high), in unit; neutral:
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


def pair_findings(
    left: np.ndarray, right: np.ndarray, disparity: np.ndarray, max_dn: float,
    device_disparity: np.ndarray | None = None,
) -> list[Finding]:  # fmt: skip
    """Measures a pair's Findings. left, right: DN [height][width]. disparity: our matcher's, px at the left image's
    pixels, 0 = none. device_disparity: the device's at the same pixels, from its depth and nominal f x baseline, 0 =
    none. Raises ValueError if too little of the image is matched, or if too few of its pixels have the device's."""
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
    # 4. Our disparity = (1 + scale) x the device's + offset: fitted with scale alone, offset alone, and both.
    device = np.asarray(device_disparity)
    both = (disparity > 0) & (device > 0)
    apart = disparity - device
    if both.any():
        both &= np.abs(apart - np.median(apart[both])) < _LARGEST_MISMATCH_PX
    if both.sum() < _LEAST_PIXELS:
        told = f"only {int(both.sum())} pixels have a disparity of both; {_LEAST_PIXELS} are needed"
        raise ValueError(f"the device's depth: {told}: check its scale, K and baseline")
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
    """Divides an image into square blocks and draws bootstrap weights for them, [draws + 1][blocks]. All weights of the
    first row are 1: it is the image itself."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._index = block_numbers(shape, _BLOCK_PX).ravel()
        self._count = int(self._index[-1]) + 1
        drawn = BlockBootstrap(self._count, _SEED, _DRAWS).weights
        # A draw of few blocks may hold none of them.
        self._weights = np.vstack([np.ones(self._count), drawn[drawn.any(axis=1)]])

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
