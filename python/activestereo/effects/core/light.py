"""The light that reaches one camera, by what sent it."""

from dataclasses import dataclass, replace

import numpy as np

from activestereo.effects.core.fine import FineImages
from activestereo.effects.core.resample import blur, sample, shifted_sum

# Rounding of the rendered float32 images; smaller changes are none.
_UNCHANGED = 1e-6
_GAIN_SIGMA_PX = 2.0


@dataclass(frozen=True)
class Light:
    """Radiance [height][width] under projector power 1 and ambient radiance 1, each the mean over the pixel's square.

    direct: the projector's light off the first surface; indirect: the rest of it; ambient: everything else;
    flat: what `direct` would be under a pattern that is 1 everywhere (visibility, falloff and reflection without the dots).
    fine: the same four as rendered, finer and wider than the frame, or None. Effects change the four and leave it alone.
    """

    direct: np.ndarray
    indirect: np.ndarray
    ambient: np.ndarray
    flat: np.ndarray
    fine: FineImages | None = None

    @classmethod
    def of(cls, layers):
        """From rendered lab layers."""
        images = (layers.direct, layers.indirect, layers.ambient, layers.flat)
        return cls(*(np.asarray(image, dtype=np.float64) for image in images), getattr(layers, "fine", None))

    @property
    def projector(self):
        return self.direct + self.indirect

    @property
    def images(self):
        """[4][height][width]: direct, indirect, ambient, flat."""
        return np.stack([self.direct, self.indirect, self.ambient, self.flat])

    def map(self, operation):
        """The same linear image operation on every light; images come stacked, [4][height][width]."""
        return Light(*operation(self.images))

    def warped(self, u, v):
        """The light whose pixels show what lies at pixel positions (u, v) [height][width] here.

        Rendered light is looked up in the fine images where there are any. What effects have changed since is known per pixel
        only: a local gain, and what that leaves."""
        if self.fine is None:
            return Light(*sample(self.images, u, v))
        return self._as(self.fine.warped(u, v), lambda rest: sample(rest, u, v), lambda gain: sample(gain, u, v, order=1))

    def blurred(self, sigma_px):
        """The light under a Gaussian blur of sigma_px, a number or an image of it; of the fine images where there are any."""
        if self.fine is None:
            return self.map(lambda images: blur(images, sigma_px))
        return self._as(self.fine.blurred(sigma_px), lambda rest: blur(rest, sigma_px))

    def shifted_sum(self, along_u, along_v):
        """The weighted sum of shifted lights, see resample.shifted_sum; of the fine images where there are any."""
        if self.fine is None:
            return self.map(lambda images: shifted_sum(images, along_u, along_v))
        return self._as(self.fine.shifted_sum(along_u, along_v), lambda rest: shifted_sum(rest, along_u, along_v))

    def _as(self, fine, of_rest, of_gain=lambda gain: gain):
        """This light with other fine images; what effects have changed since they were rendered follows by its gain and its rest."""
        moved = []
        for now, before, after in zip(self.images, self.fine.pixels, fine.pixels, strict=True):
            if np.abs(now - before).max() > _UNCHANGED * before.max():
                gain = _local_gain(before, now)
                after = np.maximum(after * of_gain(gain) + of_rest(now - gain * before), 0.0)
            moved.append(after)
        return Light(*moved, fine)

    def scale_projector(self, gain):
        """Projector light times `gain` (a number or an image); bounced light gets the mean gain of the dots."""
        total = self.direct.sum()
        mean = float((self.direct * gain).sum() / total) if total > 0 else float(np.mean(gain))
        return replace(self, direct=self.direct * gain, flat=self.flat * gain, indirect=self.indirect * mean)


def _local_gain(before, now):
    """The smooth gain that explains most of a change."""
    both, own = (blur(image, _GAIN_SIGMA_PX) for image in (before * now, before * before))
    return both / np.maximum(own, 1e-12 * own.max() + 1e-300)
