# SPDX-License-Identifier: Apache-2.0
"""Models the projector: its relative radiant intensity towards points, with its hidden effects."""

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates, maximum_filter
from scipy.signal import fftconvolve

from virtual_sensor.held_out.rig import PATTERN_WIDTH

_LEVEL_STEP_PX = 0.75
_ASTIGMATIC_TAPS = 7


class Emitter:
    """The projector with its hidden effects, {effect: {parameter: value}}; those of other stages are ignored."""

    def __init__(self, rig, hidden, seed):
        self.K = rig.projector_K()
        self._hidden = hidden
        self.pattern = (
            _with_uneven_dots(rig.pattern, seed, **hidden["dot_gain_spread"])
            if "dot_gain_spread" in hidden
            else rig.pattern
        )
        self._levels = {0: self.pattern}
        # Bounced light is smooth, so that it takes a blurred pattern, which coarse texels sample without aliasing.
        self._coarse = gaussian_filter(self.pattern, 14.0, mode="constant", truncate=3.0)

    def intensity(self, local, frame, coarse=False):
        """Returns relative radiant intensity towards points [n][3]. coarse: of a blurred pattern, for bounces."""
        h = self._hidden
        ahead = local[:, 2] > 1e-6
        z = np.where(ahead, local[:, 2], 1.0)
        x, y = local[:, 0] / z, local[:, 1] / z
        shading = self._shading(x, y, frame)
        if "pattern_scale_drift" in h:
            x, y = _diffracted(x, y, frame, **h["pattern_scale_drift"])
        if "pattern_shear" in h:  # The orders of two crossed gratings are not at right angles.
            x, y = x + h["pattern_shear"]["angle_rad"] * y, y + h["pattern_shear"]["angle_rad"] * x
        u, v = self.K[0, 0] * x + self.K[0, 2], self.K[1, 1] * y + self.K[1, 2]
        if coarse:
            value = _sample(self._coarse, u, v)
        elif "projector_defocus" in h:
            value = self._defocused(u, v, z, **h["projector_defocus"])
        elif "dot_astigmatism" in h:
            value = self._astigmatic(u, v, **h["dot_astigmatism"])
        else:
            value = _sample(self.pattern, u, v)
        return np.where(ahead, value * shading, 0.0)

    def _shading(self, x, y, frame):
        h, shading = self._hidden, np.ones_like(x)
        if "projector_vignetting" in h:  # A Gaussian beam; to second order cos^exponent.
            shading = shading * np.exp(-0.5 * h["projector_vignetting"]["exponent"] * np.arctan(np.hypot(x, y)) ** 2)
        if "laser_power_drift" in h:  # Characteristic temperature of a laser diode; ageing is linear in time.
            p = h["laser_power_drift"]
            shading = shading * np.exp(p["per_k"] * frame.warming_k) * (1.0 + p["per_s"] * frame.timestamp_s)
        if "dim_dots" in h:  # A dim region with its own soft edge.
            p = h["dim_dots"]
            away = np.minimum(np.hypot(x - p["place_x"], y - p["place_y"]) / p["radius"], 100.0)
            shading = shading * (1.0 - (p["depth"] + p["per_k"] * frame.warming_k) / np.cosh(away) ** 1.3)
        if "emitter_bands" in h:
            p = h["emitter_bands"]
            shading = shading * (
                1.0 + p["depth"] * np.sin(2 * np.pi * p["cycles"] * (x * np.cos(0.4) + y * np.sin(0.4)))
            )
        return shading

    def _defocused(self, u, v, z, aperture_px_m, focus_m):
        """Samples the pattern at (u, v), blurred by a hexagonal aperture that grows with z's distance from focus."""
        level = aperture_px_m * np.abs(1.0 / z - 1.0 / focus_m) / _LEVEL_STEP_PX
        level = np.minimum(level, 60.0)
        low = np.floor(level).astype(int)
        value = np.zeros_like(u)
        for i in np.unique(low):
            here = low == i
            part = level[here] - i
            value[here] = (1 - part) * _sample(self._level(i), u[here], v[here]) + part * _sample(
                self._level(i + 1), u[here], v[here]
            )
        return value

    def _level(self, i):
        if i not in self._levels:
            kernel = _hexagon(i * _LEVEL_STEP_PX)
            margin = kernel.shape[0] // 2
            blurred = fftconvolve(np.pad(self.pattern, margin), kernel, mode="same")
            self._levels[i] = blurred[margin : blurred.shape[0] - margin, margin : blurred.shape[1] - margin]
        return self._levels[i]

    def _astigmatic(self, u, v, sigma_px):
        """Samples the pattern with dots stretched radially with the angle. sigma_px: at the left and right end."""
        du, dv = u - self.K[0, 2], v - self.K[1, 2]
        radius = np.maximum(np.hypot(du, dv), 1e-9)
        step = sigma_px * radius / (PATTERN_WIDTH / 2)
        taps = np.linspace(-2, 2, _ASTIGMATIC_TAPS)
        weights = np.exp(-0.5 * taps**2) / np.exp(-0.5 * taps**2).sum()
        return sum(
            w * _sample(self.pattern, u + t * step * du / radius, v + t * step * dv / radius)
            for t, w in zip(taps, weights, strict=True)
        )


def _diffracted(x, y, frame, scale=0.0, per_k=0.0):
    """Moves directions by the grating equation: the sine of the angle, not its tangent, scales with the wavelength."""
    growth = 1.0 + scale + per_k * frame.warming_k
    tangent = np.hypot(x, y)
    sine = tangent / np.sqrt(1.0 + tangent**2) / growth
    ratio = np.where(tangent > 0, sine / np.sqrt(np.maximum(1e-9, 1.0 - sine**2)) / np.maximum(tangent, 1e-12), 1.0)
    return x * ratio, y * ratio


def _with_uneven_dots(pattern, seed, spread):
    """Multiplies every dot, the pixels nearest to its maximum, by a gamma variable of mean 1 and deviation `spread`."""
    peaks = (pattern == maximum_filter(pattern, 5)) & (pattern > 0.2)
    rng = np.random.Generator(np.random.PCG64([seed, 11]))
    gains = np.zeros_like(pattern)
    gains[peaks] = rng.gamma(1 / spread**2, spread**2, peaks.sum())
    nearest = distance_transform_edt(~peaks, return_distances=False, return_indices=True)
    return pattern * gains[tuple(nearest)]


def _hexagon(disc_diameter):
    """Returns the blur kernel of a regular hexagon whose variance per axis, 5 R^2 / 24, is that of a disc, D^2 / 16."""
    radius = disc_diameter * np.sqrt(24 / 80)
    if radius < 0.05:
        return np.ones((1, 1))
    half, fine = int(np.ceil(radius)) + 1, 9
    grid = (np.arange((2 * half + 1) * fine) + 0.5) / fine - half - 0.5
    x, y = np.meshgrid(grid, grid)
    inside = np.ones_like(x, dtype=bool)
    for k in range(3):
        inside &= (
            np.abs(x * np.cos(k * np.pi / 3 + np.pi / 6) + y * np.sin(k * np.pi / 3 + np.pi / 6))
            <= radius * np.sqrt(3) / 2
        )
    size = 2 * half + 1
    kernel = inside.reshape(size, fine, size, fine).mean(axis=(1, 3))
    return kernel / kernel.sum()


def _sample(image, u, v):
    return map_coordinates(image, [v, u], order=1, mode="grid-constant", cval=0.0)
