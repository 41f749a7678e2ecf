# SPDX-License-Identifier: Apache-2.0
"""Estimates noise that rows of an image share, without repeats: strips of a row agree in it, the two cameras do not."""

from __future__ import annotations

import numpy as np

from activestereo.calibrate.world.cells import Room

_STRIPS, _MOST_DN, _ROWS = 6, 4.0, 20
# Variance of a row less its neighbours' mean, for independent rows of variance 1.
_OF_DIFFERENCES = 1.5


def row_variance(room: Room) -> tuple[float, float]:
    """Returns (variance of the rows' own offsets in DN^2, its standard error). It is the covariance of strips of one
    image's rows, less the covariance of the two images of a view, which the scene makes."""
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
