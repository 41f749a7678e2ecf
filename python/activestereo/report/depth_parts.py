# SPDX-License-Identifier: Apache-2.0
"""The parts of a depth error (diagnose/answer/depth_split.py) in sentences."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from activestereo.common.shown import listed

_WORDS = {
    "any matcher": "what any matcher makes of these images",
    "image effects": "the effects found in the images",
    "filters": "the depth engine's effects",
    "calibration": "an offset and a scale of disparity",
    "temperature": "their change with temperature",
    "other matcher": "the device's own matching",
}

Split = Mapping[str, Any]


def split_sentences(split: Split | None) -> list[str]:
    """The error of the device's depth under model.json, its parts in whole percents that add up to 100, and its size by
    distance."""
    if not split:
        return []
    whole = split["after"]
    size = f"{1e3 * whole['rms_m']:.2f} mm ({whole['rms_px']:.3f} px)"
    said = [f"The device's depth errs by {size} against the geometry, RMS of {split['pixels']} pixels."]
    percent = _whole_percents([whole["parts"][name]["share_m"] for name in _WORDS])
    parts = sorted(zip(percent, _WORDS.values(), strict=True), key=lambda part: -part[0])
    makes = listed([f"{share} % comes from {words}" for share, words in parts if share > 0])
    takes = listed([f"{-share} % by {words}" for share, words in parts if share < 0])
    said.append(f"Of the square of that error {makes}" + (f", less {takes}." if takes else "."))
    if not split["images_agree"]:
        said.append("The images still lack something, which counts as any matcher's.")
    places = [
        f"{1e3 * place['after']['rms_m']:.2f} mm at {place['from_m']:.2f} to {place['to_m']:.2f} m"
        for place in split["by_distance"]
    ]
    return [*said, f"It is {listed(places)}."]


def _whole_percents(shares: Sequence[float]) -> list[int]:
    """Shares that add up to 1 as whole numbers that add up to 100: those are rounded up that lose most."""
    exact = 100.0 * np.asarray(shares)
    down = np.floor(exact).astype(int)
    short = round(exact.sum()) - int(down.sum())
    down[np.argsort(down - exact, kind="stable")[:short]] += 1
    return [int(share) for share in down]
