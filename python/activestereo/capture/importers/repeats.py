# SPDX-License-Identifier: Apache-2.0
"""Which frames of a recording are repeats of one view: by their pictures, for a hand-held camera states no poses."""

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import NDArray

_SIDE = 4  # of blocks: a dot that moves by a part of a pixel keeps some 0.4 of its variance in their means
# White noise keeps 1/16; noise that rectification has blurred, at most 0.19.
_MOST_SLOW = 0.25
_RECENT = 2  # groups of a view that a frame is compared with: its projector may blink


def repeat_groups(images: Sequence[NDArray], views: Sequence[Hashable]) -> list[int | None]:
    """The repeat group of each image [height][width] in order of time, None where no other one lies on it. views: a key
    of each image's view; images of different views are no repeats."""
    groups: list[list[int]] = []
    recent: dict[Hashable, list[list[int]]] = {}
    for k, (image, view) in enumerate(zip(images, views, strict=True)):
        near = recent.setdefault(view, [])
        group = next((g for g in near if _lies_on(image, images[g[0]])), None)
        if group is None:
            group = []
            groups.append(group)
        recent[view] = [group, *(g for g in near if g is not group)][:_RECENT]
        group.append(k)
    number = {k: n for n, group in enumerate(g for g in groups if len(g) > 1) for k in group}
    return [number.get(k) for k in range(len(images))]


def _lies_on(image: NDArray, other: NDArray) -> bool:
    """Whether two images differ by noise, brightness, rows and columns alone: means of blocks keep little of noise, and
    most of what moves."""
    first, second = image.astype(np.float32), other.astype(np.float32)
    scale = float(np.vdot(first, second)) / max(float(np.vdot(second, second)), 1.0)
    difference = first - scale * second
    difference -= difference.mean(axis=1, keepdims=True)
    difference -= difference.mean(axis=0)
    rows, columns = (length // _SIDE for length in difference.shape)
    whole = difference[: rows * _SIDE, : columns * _SIDE]
    means = whole.reshape(rows, _SIDE, columns, _SIDE).mean(axis=(1, 3))
    return bool(means.var() <= _MOST_SLOW * whole.var())
