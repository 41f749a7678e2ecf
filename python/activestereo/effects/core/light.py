"""The light that reaches one camera, by what sent it."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Light:
    """Radiance [height][width] under projector power 1 and ambient radiance 1, each the mean over the pixel's square.

    direct: the projector's light off the first surface; indirect: the rest of it; ambient: everything else;
    flat: what `direct` would be under a pattern that is 1 everywhere (visibility, falloff and reflection without the dots).
    """

    direct: np.ndarray
    indirect: np.ndarray
    ambient: np.ndarray
    flat: np.ndarray

    @classmethod
    def of(cls, layers):
        """From rendered lab layers."""
        return cls(*(np.asarray(a, dtype=np.float64) for a in (layers.direct, layers.indirect, layers.ambient, layers.flat)))

    @property
    def projector(self):
        return self.direct + self.indirect

    def map(self, operation):
        """The same linear image operation on every light; images come stacked, [4][height][width]."""
        return Light(*operation(np.stack([self.direct, self.indirect, self.ambient, self.flat])))

    def scale_projector(self, gain):
        """Projector light times `gain` (a number or an image); bounced light gets the mean gain of the dots."""
        total = self.direct.sum()
        mean = float((self.direct * gain).sum() / total) if total > 0 else float(np.mean(gain))
        return replace(self, direct=self.direct * gain, flat=self.flat * gain, indirect=self.indirect * mean)
