# SPDX-License-Identifier: Apache-2.0
"""One camera's image of one frame, beside the rendered light of the same view."""

from dataclasses import dataclass

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.compare.layers import Layers
from activestereo.effects import View


@dataclass(frozen=True)
class MeasuredImage:
    """One camera's image of one frame, without weights. measured: DN [height][width]."""

    frame: Frame
    side: str
    view: View
    layers: Layers
    measured: np.ndarray

    def where_known(self) -> np.ndarray:
        """The measured image with NaN where the scene is not known."""
        return self.measured if self.view.known is None else np.where(self.view.known, self.measured, np.nan)

    @property
    def key(self) -> tuple[int, str]:
        return self.frame.id, self.side
