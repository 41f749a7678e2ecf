# SPDX-License-Identifier: Apache-2.0
"""Classifies a model's error in infrared images: smooth brightness; weaker, softer or displaced dots; or another
shape."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, laplace

_SMOOTH_PX = 6.0  # wider than dots, narrower than changes by lights and lenses
_BLOCK_PX = 32
# Least share of the squared error beyond noise that a named shape explains; below it the shape is "other".
_LEAST_SHARE = 0.25


@dataclass(frozen=True)
class ErrorShape:
    """The shape that explains most of an error. kind: "brightness", "dots", "sharpness", "place" or "other". share:
    fraction of the squared error beyond noise that it explains. amount: measured less modelled: DN of brightness, a
    share of the dots' contrast, px² of blur, or px of displacement (unsigned)."""

    kind: str
    share: float
    amount: float


def error_shape(
    images: Iterable[tuple[NDArray, NDArray, float, NDArray[np.bool_] | None]],
) -> ErrorShape | None:
    """Finds the ErrorShape of images: (measured DN, expected DN, noise variance in DN², mask of the known scene or
    None), [height][width]. Returns None if the error does not exceed noise."""
    sums = {kind: [0.0, 0.0, 0.0] for kind in ("brightness", "dots", "sharpness", "place")}
    beyond = 0.0
    for measured, expected, floor, known in images:
        mask = np.ones(measured.shape, bool) if known is None else known
        residual = np.where(mask, measured - expected, 0.0)
        smooth = _smoothed(residual, mask)
        detail = expected - _smoothed(np.where(mask, expected, 0.0), mask)
        rest = np.where(mask, residual - smooth, 0.0)
        beyond += float((residual**2).sum() - floor * mask.sum())
        sums["brightness"][0] += float((smooth[mask] ** 2).sum())
        sums["brightness"][1] += float(smooth[mask].sum())
        sums["brightness"][2] += float(mask.sum())
        starts = [np.arange(0, size, _BLOCK_PX) for size in rest.shape]
        gradients = [np.gradient(expected, axis=axis) for axis in (0, 1)]
        for kind, templates in (("dots", [detail]), ("sharpness", [laplace(expected)]), ("place", gradients)):
            for template in templates:
                # In each block: the squares beyond noise that the template explains, and its weighted factor.
                template = np.where(mask, template, 0.0)
                cross, square = (
                    np.add.reduceat(np.add.reduceat(x, starts[0], axis=0), starts[1], axis=1)
                    for x in (rest * template, template**2)
                )
                used = square > 0.0
                explained = (cross[used] ** 2 / square[used] - floor).sum(), cross[used].sum(), square[used].sum()
                sums[kind] = [before + float(more) for before, more in zip(sums[kind], explained, strict=True)]
    if beyond <= 0.0:
        return None
    shares = {kind: own[0] / beyond for kind, own in sums.items()}
    kind = max(shares, key=lambda name: shares[name])
    share = shares[kind]
    _, weighted, weight = sums[kind]
    amount = weighted / max(weight, 1e-12)
    if kind == "place":  # both ways are displaced: the size alone
        amount = float(np.sqrt(sums[kind][0] / max(weight, 1e-12)))
    return ErrorShape(kind if share >= _LEAST_SHARE else "other", min(float(share), 1.0), float(amount))


def _smoothed(image: NDArray, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    weight = gaussian_filter(mask.astype(np.float64), _SMOOTH_PX)
    return gaussian_filter(image.astype(np.float64), _SMOOTH_PX) / np.maximum(weight, 1e-6)
