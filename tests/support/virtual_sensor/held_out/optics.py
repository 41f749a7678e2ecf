# SPDX-License-Identifier: Apache-2.0
"""Turns radiance on the subpixel grid into light on pixels: blur, stray light, shading."""

import numpy as np
from scipy.ndimage import fourier_shift, gaussian_filter
from scipy.signal import fftconvolve

from virtual_sensor.held_out.rig import HEIGHT, WIDTH

# A disc of diameter D has the variance per axis of a Gaussian of D / 4.
_DISC_PER_SIGMA = 4.0
_GLARE_SIGMA_PX, _WINDOW_PX = 45.0, 11.0


def on_pixels(layers, frame, side, hidden, rig):
    """Returns three images [HEIGHT][WIDTH] of irradiance on the sensor, in units of radiance: own projector, sky and
    lamp, second projector. layers: radiance on the subpixel grid; hidden: {effect: {parameter: value}}."""
    direct, indirect = layers.direct, layers.indirect
    if "chromatic_drift" in hidden:
        p = hidden["chromatic_drift"]
        warm = abs(frame.warming_k)
        share = 1.0 / (1.0 - p["transmission_per_k"] * warm)
        direct = share * _blurred(direct, _DISC_PER_SIGMA * p["sigma_px_per_k"] * warm)
        indirect = share * indirect
    return tuple(
        _through_lens(light, side, hidden, rig) for light in (direct + indirect, layers.sky + layers.lamp, layers.other)
    )


def _through_lens(fine, side, hidden, rig):
    if not fine.any():
        return np.zeros((HEIGHT, WIDTH))
    if "lens_psf" in hidden:
        fine = _blurred(fine, _DISC_PER_SIGMA * hidden["lens_psf"]["sigma_px"])
    if "focus_mismatch" in hidden and (side == "right") == (hidden["focus_mismatch"]["sigma_px"] > 0):
        fine = _blurred(fine, _DISC_PER_SIGMA * abs(hidden["focus_mismatch"]["sigma_px"]))
    sub = fine.shape[0] // HEIGHT
    image = fine.reshape(HEIGHT, sub, WIDTH, sub).mean(axis=(1, 3))
    if "window_haze" in hidden:
        h = hidden["window_haze"]["fraction"]
        image = (1 - h) * image + h * _halo(image)
    if "veiling_glare" in hidden:  # Half of the glare is a wide but uneven blur.
        g = hidden["veiling_glare"]["fraction"]
        image = (1 - g) * image + 0.5 * g * (
            image.mean() + gaussian_filter(image, _GLARE_SIGMA_PX, mode="reflect", truncate=2.5)
        )
    if "lens_ghost" in hidden:
        image = image + hidden["lens_ghost"]["fraction"] * image[::-1, ::-1]
    if "double_image" in hidden:
        image = image + hidden["double_image"]["fraction"] * _aside(image, **hidden["double_image"])
    return image * shading(side, hidden, rig)


def shading(side, hidden, rig):
    """Returns the lens transmission relative to that on its axis, [HEIGHT][WIDTH]."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float64)
    r2 = ((u - (WIDTH - 1) / 2) ** 2 + (v - (HEIGHT - 1) / 2) ** 2) / rig.focal_px**2
    shading = np.ones((HEIGHT, WIDTH))
    if "vignetting" in hidden:  # Rational falloff; to first order in r^2 that of cos^exponent.
        shading /= 1.0 + 0.5 * hidden["vignetting"]["exponent"] * r2
    if "lens_dust" in hidden and side == "left":
        for x, y, size in ((60, 40, 9.0), (130, 75, 13.0), (170, 30, 7.0)):
            shading *= 1.0 - hidden["lens_dust"]["depth"] * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * size**2))
    return shading


def _aside(image, fraction, shift_u_px, shift_v_px):
    """Returns the image moved right and down by real numbers of pixels (in Fourier space), dark beyond the frame."""
    moved = fourier_shift(np.fft.fft2(np.pad(image, 24)), (shift_v_px, shift_u_px))
    return np.fft.ifft2(moved).real[24:-24, 24:-24]


def _blurred(fine, diameter_px):
    """Blurs an image on the subpixel grid by a disc of the given diameter in pixels; the border reflects."""
    radius = 0.5 * diameter_px * (fine.shape[0] // HEIGHT)
    if radius < 0.2:
        return fine
    half, steps = int(np.ceil(radius)) + 1, 9
    grid = (np.arange((2 * half + 1) * steps) + 0.5) / steps - half - 0.5
    inside = (grid[:, None] ** 2 + grid[None] ** 2 <= radius**2).reshape(2 * half + 1, steps, 2 * half + 1, steps)
    kernel = inside.mean(axis=(1, 3))
    return fftconvolve(np.pad(fine, half, mode="reflect"), kernel / kernel.sum(), mode="valid")


def _halo(image):
    """Blurs the image by forward scattering of a dirty window, exp(-r / length)."""
    half = int(4 * _WINDOW_PX)
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    kernel = np.exp(-np.hypot(x, y) / _WINDOW_PX)
    return fftconvolve(np.pad(image, half, mode="reflect"), kernel / kernel.sum(), mode="valid")
