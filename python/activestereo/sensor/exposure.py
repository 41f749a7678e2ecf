# SPDX-License-Identifier: Apache-2.0
"""The exposure of many sensors behind one imager, each by what it sees: its light is scaled, and gain counts as
exposure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.auto_exposure import AutoExposure
from activestereo.effects.core.engine import EngineInputs
from activestereo.sensor.pictures import Picture


def expose_each(picture: Picture, auto: AutoExposure, inputs: EngineInputs) -> None:
    """Brings rendered pairs to their sensors' exposures. inputs: of each sensor."""
    link, shares = picture.link, picture.light_share
    if auto.mode == "fixed" and bool((shares == 1.0).all()):
        return
    is_laser_apart = picture.taken is not None and picture.taken.is_laser_apart
    links = [link, link.laser()] if is_laser_apart else [link]
    pairs = [(images := one.images()).reshape(2, shares.size, *images.shape[1:]) for one in links]
    for n, share in enumerate(shares):
        light = _light_of(pairs[0][0, n], auto, inputs) * np.float32(share)
        for images in pairs:
            images[:, n] *= light
    for one, images in zip(links, pairs, strict=True):
        one.put(images)


def _light_of(left: NDArray[np.float32], auto: AutoExposure, inputs: EngineInputs) -> np.float32:
    """How much more light than under the first setting, which the inputs have, a sensor that sees this takes."""
    if auto.mode == "fixed":
        return np.float32(1.0)
    setting = auto.after(auto.start, inputs.left.signal, left, inputs.max_dn)
    return np.float32(setting.light_s / auto.start.light_s)
