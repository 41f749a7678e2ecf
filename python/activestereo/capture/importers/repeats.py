# SPDX-License-Identifier: Apache-2.0
"""Groups a recording's frames into repeats of one view by their pictures, since a hand-held camera states no poses."""

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import NDArray

_SIDE = 4  # pixels of a block; a dot that moves by a part of a pixel keeps some 0.4 of its variance in block means
# White noise keeps 1/16; noise that rectification has blurred, at most 0.19.
_MOST_SLOW = 0.25
_RECENT = 2  # latest groups of a view that a frame is compared with, since its projector may blink


def repeat_groups(images: Sequence[NDArray], views: Sequence[Hashable]) -> list[int | None]:
    """Returns the number of each image's repeat group, None for an image without a repeat. images: [height, width]
    each, in order of time. views: key of each image's view; only images with equal keys can be repeats."""
    groups: list[list[int]] = []
    recent: dict[Hashable, list[list[int]]] = {}
    for k, (image, view) in enumerate(zip(images, views, strict=True)):
        near = recent.setdefault(view, [])
        group = next((g for g in near if _show_same_view(image, images[g[0]])), None)
        if group is None:
            group = []
            groups.append(group)
        recent[view] = [group, *(g for g in near if g is not group)][:_RECENT]
        group.append(k)
    number = {k: n for n, group in enumerate(g for g in groups if len(g) > 1) for k in group}
    return [number.get(k) for k in range(len(images))]


def _show_same_view(image: NDArray, other: NDArray) -> bool:
    """Returns whether two images show one view, so that they differ only by noise, brightness and offsets of rows and
    columns. Their difference is averaged over blocks: noise nearly vanishes, and most of a movement stays."""
    first, second = image.astype(np.float32), other.astype(np.float32)
    scale = float(np.vdot(first, second)) / max(float(np.vdot(second, second)), 1.0)
    difference = first - scale * second
    difference -= difference.mean(axis=1, keepdims=True)
    difference -= difference.mean(axis=0)
    rows, columns = (length // _SIDE for length in difference.shape)
    whole = difference[: rows * _SIDE, : columns * _SIDE]
    means = whole.reshape(rows, _SIDE, columns, _SIDE).mean(axis=(1, 3))
    return bool(means.var() <= _MOST_SLOW * whole.var())
