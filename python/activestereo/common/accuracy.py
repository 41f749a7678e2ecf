# SPDX-License-Identifier: Apache-2.0
"""Measures a depth map against the true depth: fill rate and errors of the whole image and of each material."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

NOTHING, NAMELESS = "nothing there", "unnamed material"
INVENTED_SHARE = 0.05  # of the true depth
INVENTED = f"invented: of nothing, or off by more than {100.0 * INVENTED_SHARE:g} %"


@dataclass(frozen=True)
class Accuracy:
    name: str
    pixels: int  # number of pixels with a true depth in the sensor's range
    fill: float  # share of these pixels with a measurement
    median_error_m: float  # median |measured - true| of the measured pixels; NaN without any
    p90_error_m: float  # 90th percentile of |measured - true|
    invented: float  # share of these pixels whose measurement is_invented()


def is_invented(measured: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Returns a mask of invented depths: pixels with a measurement where no surface is, or more than 5 % off the true
    depth. measured, true: metres, 0 = none."""
    return (measured > 0) & ((true <= 0) | (np.abs(measured - true) > INVENTED_SHARE * true))


def accuracy(name: str, measured: np.ndarray, true: np.ndarray, where: np.ndarray) -> Accuracy:
    """Computes the Accuracy of the pixels in the mask `where` that have a true depth. measured, true: metres [height,
    width], 0 = none."""
    where = where & (true > 0)
    hit = where & (measured > 0)
    error = np.abs(measured[hit] - true[hit])
    median, p90 = np.percentile(error, (50.0, 90.0)) if error.size else (np.nan, np.nan)
    pixels, invented = int(where.sum()), int(is_invented(measured, true)[where].sum())
    fill, invented_share = (float(count / pixels) if pixels else np.nan for count in (hit.sum(), invented))
    return Accuracy(name, pixels, fill, float(median), float(p90), invented_share)


def accuracy_by_material(
    measured: np.ndarray, true: np.ndarray, ids: np.ndarray, name_of: Callable[[int], str | None],
    max_depth: float = np.inf, least_pixels: int = 50,
) -> list[Accuracy]:  # fmt: skip
    """Computes an Accuracy for each material with at least `least_pixels` pixels, most pixels first. Then follow pixels
    without a surface, if there are as many, and all pixels in range. measured, true: metres [height, width], 0 = none.
    ids: each pixel's material number. name_of(number): its name, None = nameless. max_depth: metres."""
    in_range = (true > 0) & (true < max_depth)
    known, counts = np.unique(ids[in_range], return_counts=True)
    rows = [
        accuracy(name_of(int(material)) or NAMELESS, measured, true, in_range & (ids == material))
        for material, count in zip(known, counts, strict=True)
        if count >= least_pixels
    ]
    rows.sort(key=lambda row: -row.pixels)
    if np.count_nonzero(true <= 0) >= least_pixels:
        nothing = true <= 0  # each measurement is invented there
        share = float((measured[nothing] > 0).mean())
        rows.append(Accuracy(NOTHING, int(nothing.sum()), share, np.nan, np.nan, share))
    return [*rows, accuracy("all", measured, true, in_range)]


def accuracy_table(rows: Sequence[Accuracy]) -> str:
    """Formats the rows as an aligned text table with a header line."""
    lines = [f"{'material':16}{'pixels':>9}{'measured':>11}{'median error':>15}{'90 % within':>14}{'invented':>11}"]
    for row in rows:
        both = row.median_error_m, row.p90_error_m
        median, p90 = (f"{1e3 * error:.1f} mm" if np.isfinite(error) else "-" for error in both)
        measured, invented = (f"{100.0 * share:.1f} %" if row.pixels else "-" for share in (row.fill, row.invented))
        lines.append(f"{row.name[:15]:16}{row.pixels:>9}{measured:>11}{median:>15}{p90:>14}{invented:>11}")
    return "\n".join(lines)
