# SPDX-License-Identifier: Apache-2.0
"""Reads a recording's infrared pairs one after another, from a bag or a folder of PNG files, without copying the
recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.images import read_gray
from activestereo.capture.importers.bag import is_bag, read_pairs
from activestereo.capture.importers.realsense_folder import frame_files

_MOST_OF_8_BITS = 255


@dataclass(frozen=True)
class Pair:
    """Two rectified images of one size, uint8, or uint16 if the first pair has counts above 255. name: unique in the
    recording and usable as a file name."""

    name: str
    left: NDArray[np.generic]
    right: NDArray[np.generic]


def recorded_pairs(path: Path, is_wanted: Callable[[str], bool] = lambda name: True) -> Iterator[Pair]:
    """Yields the infrared pairs in order of time. is_wanted(name): decides whether to decode a pair. Raises ValueError,
    one line, with the recording and its fault, once the pairs before the fault have been yielded."""
    if is_bag(path):
        pairs = read_pairs(path, is_wanted)
    else:
        pairs = (
            (name, read_gray(entry.files["left"], key="left"), read_gray(entry.files["right"], key="right"))
            for number, entry in enumerate(frame_files(path))
            if is_wanted(name := f"{number:06d}")
        )
    first: NDArray[np.generic] | None = None
    for name, left, right in pairs:
        if left.shape != right.shape or (first is not None and left.shape != first.shape):
            sizes = " and ".join(f"{image.shape[1]}x{image.shape[0]}" for image in (left, right))
            expected = "" if first is None else f", the pairs before {first.shape[1]}x{first.shape[0]}"
            raise ValueError(f"{path}: {name}: left and right are {sizes}{expected}: they must be of one size")
        if first is None:
            is_byte = max(int(left.max()), int(right.max())) <= _MOST_OF_8_BITS
            first = left.astype(np.uint8 if is_byte else np.uint16)
        elif first.dtype == np.uint8 and max(int(left.max()), int(right.max())) > _MOST_OF_8_BITS:
            raise ValueError(f"{path}: {name}: has counts above 255, where the pairs before have 8 bits")
        yield Pair(name, left.astype(first.dtype), right.astype(first.dtype))
