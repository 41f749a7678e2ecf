# SPDX-License-Identifier: Apache-2.0
"""Exposes many sensors behind one imager, each for its own view: scales its light, and counts gain as exposure."""

from __future__ import annotations

import numpy as np

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
    light = shares.astype(np.float32)
    if auto.mode != "fixed":
        light *= auto.settled_light(inputs.left.signal, pairs[0][0], inputs.max_dn)
    for images in pairs:
        images *= light[:, None, None]
    for one, images in zip(links, pairs, strict=True):
        one.put(images)
