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

    @property
    def key(self) -> tuple[int, str]:
        return self.frame.id, self.side
