# SPDX-License-Identifier: Apache-2.0
"""Automatic exposure and gain with librealsense's options: a target mean count, an image region to measure, and limits
of exposure and gain. Exposure changes first; gain changes only when exposure is at its limit. The devices' control
steps are not published. Here a step corrects _DAMPING of the error in the logarithm of light, by a factor of at most
two. Clipped pixels make a step too small, never wrong. Counts follow the imager's response and warm black level."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.common import srgb as srgb_curve

_DAMPING = 0.8
_LARGEST_STEP = 2.0
_SETTLED = 0.002  # a step with a smaller relative change ends the control
_MOST_STEPS = 60
_MOST_RELATIVE = np.float32(4.0)  # a response is cut there, as simsense's
_VIEWS = 16  # images at a time, which stay in the processor's cache
STRIDE = 2  # only every second pixel is measured, in x and y
DARKEST = np.finfo(np.float32).tiny  # smallest count of a lit pixel; devices may treat less as 0
_BLOCK = 1 << 16  # numbers at a time, which stay in the processor's cache


@dataclass(frozen=True)
class Setting:
    exposure_s: float
    gain: float

    def applied_to(self, signal: Mapping[str, float]) -> dict[str, float]:
        """Returns the imagers' parameters with this exposure and gain. signal: the parameters at gain 1."""
        return {**signal, "exposure_s": self.exposure_s, "gain": signal["gain"] * self.gain}

    @property
    def light_s(self) -> float:
        return self.exposure_s * self.gain


@dataclass(frozen=True)
class AutoExposure:
    """The exposure control of one sensor. mode: 'fixed', 'converging' or 'settled'. start: the first setting.
    target_dn: the wanted mean count in `region` (left, top, right, bottom), or in the whole image if None."""

    mode: str
    start: Setting
    target_dn: float
    exposure_limits_s: tuple[float, ...]
    gain_limits: tuple[float, ...]
    region: tuple[int, int, int, int] | None = None

    def after(self, now: Setting, signal: Mapping[str, float], light: NDArray[np.float32], max_dn: float) -> Setting:
        """Returns the setting for the next image after one taken with `now`. Mode 'converging' takes one control step
        from `now`; other modes run the control from `start` until it settles. signal: the imager's parameters at `now`.
        light: radiance [height, width]. max_dn: the count at which pixels clip."""
        seen = self._metered_counts(light[None], signal, now)
        begin = np.array([(now if self.mode == "converging" else self.start).light_s])
        follow = self._step if self.mode == "converging" else self._settled
        light_s = float(follow(begin, seen, signal, max_dn)[0])
        (shortest_s, longest_s), (least, most) = self.exposure_limits_s, self.gain_limits
        exposure_s = min(max(light_s / least, shortest_s), longest_s)
        return Setting(exposure_s, min(max(light_s / exposure_s, least), most))

    def settled_light(
        self, signal: Mapping[str, float], light: NDArray[np.float32], max_dn: float
    ) -> NDArray[np.float32]:
        """Returns [n]: for each image, the exposure x gain at which the control settles, divided by that of `start`.
        light: radiance [n, height, width]. signal: simsense's imager parameters at the setting `start`. max_dn: the
        count at which pixels clip."""
        begin = np.full(_VIEWS, self.start.light_s)
        parts = [self._metered_counts(light[n : n + _VIEWS], signal, self.start) for n in range(0, len(light), _VIEWS)]
        found = [self._settled(begin[: len(seen)], seen, signal, max_dn) for seen in parts]
        return np.asarray(np.concatenate(found) / self.start.light_s, np.float32)

    def _metered_counts(
        self, light: NDArray[np.float32], signal: Mapping[str, float], now: Setting
    ) -> NDArray[np.float32]:
        """Returns the counts above black [n, pixels] in the metering region of n images for exposure x gain = 1 s, of
        every second pixel in x and y. light: radiance [n, height, width]. signal: parameters at the setting `now`."""
        dn_per_light_s = signal["responsivity_e"] * signal["conversion_gain_dn_per_e"] * signal["gain"] / now.gain
        left, top, right, bottom = self.region or (0, 0, light.shape[2], light.shape[1])
        looked_at = np.asarray(light[:, top:bottom:STRIDE, left:right:STRIDE], dtype=np.float32)
        return np.asarray((looked_at * np.float32(dn_per_light_s)).reshape(len(light), -1))

    def _settled(
        self, light_s: NDArray[np.float64], seen: NDArray[np.float32], signal: Mapping[str, float], max_dn: float
    ) -> NDArray[np.float64]:
        light_s, moving = light_s.copy(), np.arange(len(seen))
        for _ in range(_MOST_STEPS):
            after = self._step(light_s[moving], seen[moving], signal, max_dn)
            is_still = np.abs(after / light_s[moving] - 1.0) < _SETTLED
            light_s[moving], moving = after, moving[~is_still]
            if not moving.size:
                break
        return light_s

    def _step(
        self, light_s: NDArray[np.float64], seen: NDArray[np.float32], signal: Mapping[str, float], max_dn: float
    ) -> NDArray[np.float64]:
        """Makes one control step for each of n images and returns the new exposure x gain, seconds [n]. light_s: the
        current values [n]. seen: [n, pixels], DN above black per second of exposure x gain, from _metered_counts()."""
        black_dn, exponent = black_level(signal), signal["response_exponent"]
        counts = seen * light_s.astype(np.float32)[:, None]
        if exponent != 1.0:
            relative = np.minimum(counts / np.float32(max_dn), _MOST_RELATIVE)
            counts = np.float32(max_dn) * relative ** np.float32(exponent)
        counts += np.float32(black_dn)
        np.clip(counts, np.float32(0.0), np.float32(max_dn), out=counts)
        mean_dn = counts.mean(axis=1).astype(np.float64)
        # If black alone exceeds the target, the steps end at the shortest exposure.
        wanted = max(self.target_dn - black_dn, 0.0) / np.maximum(mean_dn - black_dn, 1e-6)
        after = light_s * np.clip(wanted ** (_DAMPING / exponent), 1.0 / _LARGEST_STEP, _LARGEST_STEP)
        (shortest_s, longest_s), (least, most) = self.exposure_limits_s, self.gain_limits
        return np.asarray(np.clip(after, shortest_s * least, longest_s * most))


def black_level(signal: Mapping[str, float]) -> float:
    """Returns the counts of an imager in the dark at its temperature, without dark current."""
    return signal["black_level_dn"] + signal["black_level_dn_per_k"] * (
        signal["temperature_c"] - signal["dark_reference_c"]
    )


def rgb_exposure(radiance: NDArray[np.float32]) -> float:
    """Computes the exposure factor that puts the median lit pixel's green at a quarter of white; 1 if no pixel is lit.
    It uses float32, as kuafu's output `srgb` does. Of the median only the upper 16 bits count; the lower ones are set
    to the middle of their range. radiance: float32 [..., height, width, 3]."""
    green = radiance[..., ::STRIDE, ::STRIDE, 1]
    lit = green[(green >= DARKEST) & (green < np.inf)]
    if not lit.size:
        return 1.0
    middle = (lit.size - 1) // 2
    return exposure_of_median(np.partition(lit, middle)[middle])


def exposure_of_median(green: np.float32) -> float:
    """Computes the factor of rgb_exposure() from the image's median green value. For an even number of pixels this is
    the lower median."""
    shared = (np.float32(green).view(np.uint32) & np.uint32(0xFFFF0000) | np.uint32(0x8000)).view(np.float32)
    return float(max(np.float32(0.25) / shared, DARKEST))


def srgb(linear: NDArray[np.float32], factor: float = 1.0) -> NDArray[np.float32]:
    """Applies sRGB's transfer curve (IEC 61966-2-1) to linear values times a factor, clipped to 0..1. It is accurate to
    2e-5. It reads a table over the value's square root, in which the curve is nearly straight."""
    light = np.ascontiguousarray(linear).reshape(-1)
    out = np.empty_like(light)
    scratch = np.empty(min(_BLOCK, light.size), dtype=np.float32)
    for start in range(0, light.size, _BLOCK):
        root = scratch[: light.size - start]
        np.multiply(light[start : start + _BLOCK], np.float32(factor), out=root)
        np.maximum(root, np.float32(0.0), out=root)
        np.minimum(root, np.float32(1.0), out=root)
        np.sqrt(root, out=root)
        root *= len(SRGB) - 1
        root += 0.5
        np.take(SRGB, root.astype(np.uint16), out=out[start : start + _BLOCK], mode="clip")
    return out.reshape(linear.shape)


# The table's index is the square root of the linear value, from 0 to 1.
SRGB = srgb_curve.encoded(np.linspace(0.0, 1.0, 1 << 16) ** 2).astype(np.float32)
