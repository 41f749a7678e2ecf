# SPDX-License-Identifier: Apache-2.0
"""Turns radiance into digital numbers, with multiplicative speckle, shot noise, read noise and rounding."""

from dataclasses import dataclass

import numpy as np

from virtual_sensor.pcg import Pcg


@dataclass(frozen=True)
class Sensor:
    """An imager's figures. scales: DN per s x gain x radiance; shot: variance per DN; speckle_k: gamma shape."""

    projector_scale: float
    ambient_scale: float
    black_dn: float = 4.0
    read_dn: float = 1.0
    shot: float = 0.0
    speckle_k: float = 60.0
    max_dn: int = 255


def expected(sensor, view, exposure_gain, power):
    """Returns the noise-free image in DN, unclipped. exposure_gain: seconds x gain; power: 1 = nominal."""
    projector = sensor.projector_scale * power * (view.direct + view.indirect)
    return sensor.black_dn + exposure_gain * (projector + sensor.ambient_scale * view.sky)


def expose(sensor, view, exposure_gain, power, seed):
    """Returns one noisy exposure, uint8 [height][width]. Arguments are as in expected()."""
    rng = Pcg(view.sky.shape, seed, sequence=1)
    signal = expected(sensor, view, exposure_gain, power) - sensor.black_dn
    value = signal * rng.gamma(sensor.speckle_k)
    value += np.sqrt(sensor.shot * signal) * rng.normal() + sensor.read_dn * rng.normal() + sensor.black_dn
    return np.clip(np.rint(value), 0, sensor.max_dn).astype(np.uint8)
