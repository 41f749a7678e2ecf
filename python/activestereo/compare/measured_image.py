# SPDX-License-Identifier: Apache-2.0
"""One camera's image of one frame beside the rendered light of the same view."""

from dataclasses import dataclass

import numpy as np

from activestereo.capture.capture import Frame, ImageKey
from activestereo.effects import View
from activestereo.effects.core.layers import Layers


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
    def key(self) -> ImageKey:
        return self.frame.id, self.side
