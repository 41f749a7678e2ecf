# SPDX-License-Identifier: Apache-2.0
"""The exposure of a batch's pictures, each sensor's by what it sees. Gain counts as exposure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.auto_exposure import AutoExposure
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.effects.core.engine import EngineInputs
from activestereo.sensor.pipelined_pictures import Picture


class BatchExposure:
    """ValueError for an exposure that depends on the pictures before, which one configuration of many has not."""

    def __init__(self, config: StereoDepthSensorConfig) -> None:
        self._config, self._auto = config, AutoExposure(config)
        if self._auto.mode == "converging":
            raise ValueError("ir_exposure_mode of a batch is 'fixed' or 'settled', not 'converging'")

    def expose(self, picture: Picture, inputs: EngineInputs) -> None:
        """Brings rendered pairs to their sensors' exposures, and to the engine. inputs: of each sensor."""
        link, shares = picture.link, picture.light_share
        if self._auto.mode != "fixed" or not bool((shares == 1.0).all()):
            is_laser_apart = picture.taken is not None and picture.taken.is_laser_apart
            links = [link, link.laser()] if is_laser_apart else [link]
            pairs = [(images := one.images()).reshape(2, shares.size, *images.shape[1:]) for one in links]
            for n, share in enumerate(shares):
                light = self._light_of(pairs[0][0, n], inputs) * np.float32(share)
                for images in pairs:
                    images[:, n] *= light
            for one, images in zip(links, pairs, strict=True):
                one.put(images)
        link.deliver()

    def _light_of(self, left: NDArray[np.float32], inputs: EngineInputs) -> np.float32:
        """How much more light than under the configuration's exposure a sensor that sees this takes."""
        if self._auto.mode == "fixed":
            return np.float32(1.0)
        setting = self._auto.after(self._config, inputs.left.signal, left, inputs.max_dn)
        return np.float32(setting.light_s / self._auto.start.light_s)
