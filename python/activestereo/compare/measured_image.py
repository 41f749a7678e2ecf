# SPDX-License-Identifier: Apache-2.0
"""Defines one measured image of a capture, and the warp that maps left pixels into the right camera's image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from activestereo.capture.capture import Frame, ImageKey
from activestereo.common.lens import is_distorting, is_drawn
from activestereo.effects.core.view import Layers, View


@dataclass(frozen=True)
class MeasuredImage:
    """One camera's image of one frame. measured: DN [height][width]. layers: the rendered light of the view."""

    frame: Frame
    side: str
    view: View
    layers: Layers
    measured: np.ndarray

    def where_known(self) -> np.ndarray:
        """Returns the measured image with NaN at pixels where the scene is unknown."""
        return self.measured if self.view.known is None else np.where(self.view.known, self.measured, np.nan)

    def forget(self) -> None:
        """Drops what view and light keep, gigabytes of large images; it is computed again where it is needed."""
        self.view.forget()
        self.layers.forget()

    @property
    def key(self) -> ImageKey:
        return self.frame.id, self.side


_OCCLUSION = 0.02  # above this relative difference of depth the cameras see different surfaces


@dataclass(frozen=True)
class Warp:
    """Maps each left pixel to the position (u, v) of its surface point in the right camera's image, px [height][width].
    seen: mask of the left pixels whose surface the right camera sees, too."""

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    seen: NDArray[np.bool_]

    def read(self, right: NDArray[np.generic], shift_px: float = 0.0, order: int = 1) -> NDArray[np.float64]:
        """Returns the right image at (u + shift_px, v) of each left pixel, [height][width]. order: degree of the
        interpolating spline."""
        return map_coordinates(np.asarray(right, np.float64), [self.v, self.u + shift_px], order=order, mode="nearest")


def warp_between(left: View, right: View) -> Warp:
    """Computes the Warp between both cameras' views of one frame from the scene's depth."""
    height, width = left.shape
    x, y = left.rays()
    points = np.stack([x, y, np.ones_like(x)]) * left.depth_m
    pose = right.left_to_camera
    there = np.tensordot(pose[:3, :3], points, axes=1) + pose[:3, 3][:, None, None]
    z = np.where(there[2] > 1e-6, there[2], 1.0)
    x, y = there[0] / z, there[1] / z
    drawn = left.depth_m > 0
    if is_distorting(right.distortion):
        drawn &= is_drawn(x, y, right.distortion)
    to_u, to_v = right.to_pixels(x, y)
    inside = drawn & (to_u >= 1) & (to_u <= width - 2) & (to_v >= 1) & (to_v <= height - 2)
    depth = map_coordinates(right.depth_m, [to_v, to_u], order=0, mode="nearest")
    return Warp(to_u, to_v, inside & (np.abs(depth - there[2]) < _OCCLUSION * z))
