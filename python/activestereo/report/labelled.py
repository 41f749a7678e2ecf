# SPDX-License-Identifier: Apache-2.0
"""Draws pictures of one frame side by side, each with its name; depth comes with a colour bar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from numpy.typing import NDArray

from activestereo.common.palette import INK, MUTED

_PANEL_IN, _TITLE_IN, _BAR_IN = 4.0, 0.35, 0.6
_NOTHING = "black"


@dataclass(frozen=True)
class Labelled:
    """Names a picture: RGB [height][width][3] or grey [height][width] in 0..1, or depth [height][width] in metres, 0 =
    none. near_far_m: the ends of the depth scale; None for no depth."""

    name: str
    image: NDArray
    near_far_m: tuple[float, float] | None = None


def labelled_figure(pictures: Sequence[Labelled], columns: int) -> Figure:
    """Draws the pictures in rows of `columns`. Measured depth is coloured, and black where there is none."""
    rows = -(-len(pictures) // columns)
    aspect = pictures[0].image.shape[0] / pictures[0].image.shape[1]
    has_depth = any(picture.near_far_m is not None for picture in pictures)
    size = columns * _PANEL_IN + has_depth * _BAR_IN, rows * (_PANEL_IN * aspect + _TITLE_IN)
    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    colours = colormaps["viridis_r"].with_extremes(bad=_NOTHING)
    for place, picture in zip(figure.subplots(rows, columns, squeeze=False).ravel(), pictures, strict=False):
        if picture.near_far_m is None:
            place.imshow(np.clip(picture.image, 0.0, 1.0), cmap="gray", vmin=0.0, vmax=1.0)
        else:
            known = np.ma.masked_equal(picture.image, 0.0)
            near, far = picture.near_far_m
            shown = place.imshow(known, cmap=colours, vmin=near, vmax=far, interpolation="nearest")
            bar = figure.colorbar(shown, ax=place, extend="both", fraction=0.04, pad=0.02)
            bar.set_label("m (black: none)", size=8, color=MUTED)
            bar.ax.tick_params(labelsize=8, colors=MUTED)
        place.set_title(picture.name, size=10, color=INK, loc="left")
        place.set_axis_off()
    return figure
