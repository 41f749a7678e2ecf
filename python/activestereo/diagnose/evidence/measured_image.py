# SPDX-License-Identifier: Apache-2.0
"""One camera's image of one frame beside the rendered light of the same view."""

import os
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Frame, ImageKey
from activestereo.compare.nuisances import predict
from activestereo.effects import View
from activestereo.effects.core.layers import Layers
from activestereo.effects.core.model import Nuisances, scales


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

    @property
    def key(self) -> tuple[int, str]:
        return self.frame.id, self.side


def derivatives_in_dn(
    images: Sequence[MeasuredImage],
    nuisances: Nuisances,
    of_light: Callable[[MeasuredImage], NDArray[np.float32]],
) -> dict[ImageKey, NDArray[np.float32]]:
    """Returns {(frame id, side): derivatives of an image, DN, [...][height][width]}, 0 at clipped pixels.

    of_light(image): returns the derivatives of the projector's light and of the ambient light, [2][...][height][width].
    All images of one pose and camera share them.
    """
    views = [(image.side, image.frame.camera_to_world.tobytes()) for image in images]
    first = dict(reversed(list(zip(views, images, strict=True))))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        known = dict(zip(first, pool.map(of_light, first.values()), strict=True))
    alike: dict[Hashable, NDArray[np.float32]] = {}  # repeats share theirs
    out = {}
    for light, image in zip(views, images, strict=True):
        projector, ambient = scales(image.frame)
        if (of_both := (light, projector, ambient)) not in alike:
            levels = np.array([nuisances.projector_scale * projector, nuisances.ambient_scale * ambient], np.float32)
            expected = predict(image.frame, image.layers, nuisances, image.view.max_dn)
            inside = (expected > 0.0) & (expected < image.view.max_dn)
            alike[of_both] = np.tensordot(levels, known[light], axes=1) * inside
        out[image.key] = alike[of_both]
    return out
