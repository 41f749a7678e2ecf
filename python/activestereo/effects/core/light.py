# SPDX-License-Identifier: Apache-2.0
"""Holds the light of one camera under effects. Operations run only when an image is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import ClassVar

import numpy as np

from activestereo.common.computed_once import Remembering, once_of_picked
from activestereo.effects.core.resample import Spline, SupersampledImages, blur, interpolated
from activestereo.effects.core.view import Layers, View

# Smaller relative changes are rounding of the rendered float32 images.
_UNCHANGED = 1e-6
_GAIN_SIGMA_PX = 2.0
_PROJECTOR, _AMBIENT = ("direct", "indirect"), ("ambient",)


@dataclass(frozen=True)
class Light(Remembering):
    """Radiance [height][width] under projector power 1 and ambient radiance 1, averaged over each pixel's square.

    direct: projector light off the first surface. indirect: the rest of the projector's light. ambient: all other
    light. flat: `direct` under a pattern that is 1 everywhere (visibility, falloff and reflection without the dots).
    supersampled: the same four images as rendered, finer and wider than the frame, or None. Effects change the four
    images and never `supersampled`.
    """

    direct: np.ndarray
    indirect: np.ndarray
    ambient: np.ndarray
    flat: np.ndarray
    supersampled: SupersampledImages | None = None
    _later: ClassVar[_Later | None] = None

    def __getattr__(self, name: str) -> np.ndarray:
        """Returns an image that results from an operation on another Light, computed on first use."""
        if name not in _NAMES or self._later is None:
            raise AttributeError(name)
        return self.__dict__.setdefault(name, self._later.image((name,)))

    @classmethod
    def of(cls, layers: Light | Layers) -> Light:
        """Returns the Light of rendered images."""
        images = (layers.direct, layers.indirect, layers.ambient, layers.flat)
        return cls.of_images([np.asarray(image, dtype=np.float64) for image in images], layers.supersampled)

    @classmethod
    def of_images(
        cls, images: Sequence[np.ndarray] | np.ndarray, supersampled: SupersampledImages | None = None
    ) -> Light:
        """Returns the Light of four images [4][height][width]: direct, indirect, ambient, flat."""
        direct, indirect, ambient, flat = images
        return cls(direct, indirect, ambient, flat, supersampled)

    @property
    def projector(self) -> np.ndarray:
        return self.sum_of(_PROJECTOR)

    @property
    def images(self) -> np.ndarray:
        """Returns the four images [4][height][width]: direct, indirect, ambient, flat."""
        return np.stack([self.direct, self.indirect, self.ambient, self.flat])

    def sum_of(self, names: tuple[str, ...]) -> np.ndarray:
        """Returns the sum [height][width] of the named images, such as ("direct", "indirect"). A pending operation is
        applied to the sum alone, not to each image."""
        if len(names) == 1:
            return getattr(self, names[0])
        if self._later is None or any(name in self.__dict__ for name in names):
            return self.once(("sum", names), lambda: sum(getattr(self, name) for name in names))
        return self.once(("sum", names), partial(self._later.image, names))

    def seen(self, pick: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray]:
        """Returns (projector light, ambient light) of the selected pixels, float64 [n] each. pick: flat indices of the
        pixels."""
        later, has_images = self._later, {"direct", "indirect", "ambient"} & self.__dict__.keys()
        if later is None or later.at is None or has_images or isinstance(pick, slice) or pick.size >= later.size:
            return self.projector.ravel()[pick], self.ambient.ravel()[pick]
        at = later.at
        # A fit asks for the same pixels again: for its slopes, and for other frames of this light.
        seen: tuple[np.ndarray, np.ndarray] = once_of_picked(
            self.once("seen", list), pick, lambda: (at(_PROJECTOR, pick), at(_AMBIENT, pick))
        )
        return seen

    def at(self, pick: np.ndarray) -> Light:
        """Returns the light of the selected pixels alone, as images [1][n]. pick: flat indices of the pixels."""
        at = self._later and self._later.at
        image = lambda name: at((name,), pick) if at else getattr(self, name).ravel()[pick]  # noqa: E731
        some: Light = once_of_picked(
            self.once("at", list), pick, lambda: Light.of_images([image(name)[None] for name in _NAMES])
        )
        return some

    def pointwise(self, act: Callable[[Light, View], Light], view: View) -> Light:
        """Returns act(self, view), computed later and only for the pixels that are then asked for. Each pixel of act's
        result must depend on that pixel alone."""
        some: list[tuple[np.ndarray, Light]] = []
        acted = cache(lambda: act(self, view))
        acted_at = lambda pick: once_of_picked(some, pick, lambda: act(self.at(pick), view.at(pick)))  # noqa: E731
        return _Later(
            self,
            of_supersampled=lambda images: images,
            whole=lambda names: acted().sum_of(names),
            at=lambda names, pick: acted_at(pick).sum_of(names)[0],
            size=view.depth_m.size,
        ).light()

    def map(self, operation: Callable[[np.ndarray], np.ndarray]) -> Light:
        """Returns the light after a linear operation on its images. The operation takes and returns a stack
        [...][height][width]."""
        return _Later(self, operation).light()

    def warped(self, u: np.ndarray, v: np.ndarray) -> Light:
        """Returns the warped light: its pixel takes this light's value at pixel position (u, v), [height][width] each.

        Values are interpolated in the supersampled images if there are any. Changes by effects since rendering are
        known per camera pixel only. They are split into a smooth local gain and a remainder, which are warped
        separately.
        """
        spline = lambda names: self.once(("spline", names), lambda: Spline(self.sum_of(names)))  # noqa: E731
        of_rest = lambda names: self.once(("rest", names), lambda: Spline(self.since_rendered(names)[1]))  # noqa: E731

        def at(names: tuple[str, ...], pick: np.ndarray | slice) -> np.ndarray:
            own_u, own_v = u.ravel()[pick], v.ravel()[pick]
            if later.supersampled is None:
                return spline(names)(own_u, own_v)
            changed = self.is_changed(names)
            if changed and len(names) > 1:
                return np.sum([at((name,), pick) for name in names], axis=0)
            after = later.supersampled.sum_of(_places(names)).pixels_at(pick)[0]
            if not changed:
                return after
            gain = interpolated(self.since_rendered(names)[0], own_u, own_v)
            return np.maximum(after * gain + of_rest(names)(own_u, own_v), 0.0)

        later = _Later(
            self,
            of_supersampled=lambda images: images.warped(u, v),
            whole=lambda names: at(names, slice(None)).reshape(u.shape),
            at=at,
            size=u.size,
        )
        return later.light()

    def is_changed(self, names: tuple[str, ...]) -> bool:
        """Returns whether effects have changed the named images' sum since the supersampled ones were rendered."""

        def changed() -> bool:
            before = self.rendered(names)
            return bool(np.abs(self.sum_of(names) - before).max() > _UNCHANGED * before.max())

        return self.once(("changed", names), changed)

    def rendered(self, names: tuple[str, ...]) -> np.ndarray:
        """Returns the named images' sum as rendered, [height][width]: the supersampled images' means over pixels."""
        assert self.supersampled is not None
        return self.supersampled.sum_of(_places(names)).pixels()[0]

    def since_rendered(self, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Splits what effects have changed in the named images' sum: returns (the smooth local gain that explains most
        of it, the rest that is added to gain times the rendered sum), [height][width] each."""

        def split() -> tuple[np.ndarray, np.ndarray]:
            now, before = self.sum_of(names), self.rendered(names)
            assert self.supersampled is not None
            own = self.supersampled.once(("square", names), lambda: blur(before * before, _GAIN_SIGMA_PX))
            gain = blur(before * now, _GAIN_SIGMA_PX) / np.maximum(own, 1e-12 * own.max() + 1e-300)
            return gain, now - gain * before

        parts: tuple[np.ndarray, np.ndarray] = self.once(("since rendered", names), split)
        return parts

    def blurred(self, sigma_px: float | np.ndarray) -> Light:
        """Returns the light after a Gaussian blur. sigma_px: pixels, a number or an image."""
        return self.filtered(lambda images: images.blurred(sigma_px))

    def filtered(self, act: Callable[[SupersampledImages], SupersampledImages]) -> Light:
        """Returns the light after a linear filter, of the supersampled images where there are any. act: a filter of
        SupersampledImages, such as blurred() and shifted_sum(); without supersampled images it gets the pixels at scale
        1."""
        return _Later(self, lambda images: act(SupersampledImages(images, 1, 0)).images(), act).light()

    def scale_projector(self, gain: float | np.ndarray) -> Light:
        """Returns the light with the projector's direct light times `gain`, a number or an image. Bounced light gets
        the mean gain of the dots."""
        total = self.direct.sum()
        mean = float((self.direct * gain).sum() / total) if total > 0 else float(np.mean(gain))
        return replace(self, direct=self.direct * gain, flat=self.flat * gain, indirect=self.indirect * mean)


_NAMES = ("direct", "indirect", "ambient", "flat")


def _places(names: tuple[str, ...]) -> tuple[int, ...]:
    """Returns the positions of the named images in the order (direct, indirect, ambient, flat)."""
    return tuple(map(_NAMES.index, names))


@dataclass
class _Later:
    """A linear operation on a Light that waits until an image is asked for.

    of_images: the operation on images [n][height][width]. of_supersampled: the same on SupersampledImages; None: the
    result has none. whole(names): computes the sum of the named images; None: of_images does. at(names, pick): that sum
    at flat pixel indices, fewer than `size`.
    """

    source: Light
    of_images: Callable[[np.ndarray], np.ndarray] = lambda images: images
    of_supersampled: Callable[[SupersampledImages], SupersampledImages] | None = None
    whole: Callable[[tuple[str, ...]], np.ndarray] | None = None
    at: Callable[[tuple[str, ...], np.ndarray | slice], np.ndarray] | None = None
    size: int = 0

    def __post_init__(self) -> None:
        fine = self.source.supersampled
        self.supersampled = None if fine is None or self.of_supersampled is None else self.of_supersampled(fine)

    def light(self) -> Light:
        light = object.__new__(Light)
        light.__dict__.update(_later=self, supersampled=self.supersampled)
        return light

    def image(self, names: tuple[str, ...]) -> np.ndarray:
        """Returns the sum of the named images after the operation, [height][width]."""
        if self.whole is not None:
            return self.whole(names)
        if self.supersampled is None:
            return self.of_images(self.source.sum_of(names)[None])[0]
        changed = self.source.is_changed(names)
        if changed and len(names) > 1:
            return np.sum([self.image((name,)) for name in names], axis=0)
        after = self.supersampled.sum_of(_places(names)).pixels()[0]
        if not changed:
            return after
        gain, rest = self.source.since_rendered(names)
        return np.maximum(after * gain + self.of_images(rest[None])[0], 0.0)
