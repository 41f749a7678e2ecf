# SPDX-License-Identifier: Apache-2.0
"""Effects of the imager, behind the light's own noise, and of lamps on the mains."""

from __future__ import annotations

import numpy as np

from activestereo.benchmarks.inject.light import Light, View


def gain(light: Light, view: View, excess: float) -> Light:
    """An amplifier that multiplies light and noise by 1 + excess."""
    return light.scaled(1.0 + excess)


def black_level(light: Light, view: View, offset_dn: float) -> Light:
    """A pedestal that is there without light."""
    return Light(light.value + offset_dn, light.variance)


def row_noise(light: Light, view: View, sigma_dn: float) -> Light:
    """Adds an offset of its own to every row of every image."""
    offsets = sigma_dn * view.temporal.standard_normal((light.value.shape[0], 1))
    return Light(light.value + offsets, light.variance)


def response(light: Light, view: View, compression: float) -> Light:
    """A response that saturates softly: y = x (1 + c) / (1 + c x / full scale). Full scale stays fixed."""
    relative = np.maximum(light.value, 0.0) / view.max_dn
    below = 1.0 + compression * relative
    slope = (1.0 + compression) / below**2
    value = np.where(light.value > 0.0, view.max_dn * relative * (1.0 + compression) / below, light.value)
    return Light(value, light.variance * slope**2)


def bands(light: Light, view: View, depth: float, frequency_hz: float, phase_rad: float) -> Light:
    """Light that swings with the mains and is read row by row: bands that roll from frame to frame. depth: amplitude
    over mean in the image, after the exposure's average."""
    height = light.value.shape[0]
    time_s = view.time_s + (np.arange(height) - (height - 1) / 2) * view.row_time_s
    return light.scaled(1.0 + depth * np.cos(2.0 * np.pi * frequency_hz * time_s + phase_rad)[:, None])
