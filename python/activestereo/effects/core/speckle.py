# SPDX-License-Identifier: Apache-2.0
"""Speckle: laser light off a rough surface varies from grain to grain with a gamma distribution (Goodman, Speckle
Phenomena in Optics, 3.4)."""

from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


def speckled(light: Light, view: View, name: str, contrast: float, per: str) -> Light:
    """Projector light times a gamma variable of mean 1 and deviation `contrast` per pixel, drawn independently per
    `per` of View.rng."""
    if contrast == 0.0:
        return light
    grains = 1.0 / contrast**2
    return light.scale_projector(view.rng(name, per=per).gamma(grains, 1.0 / grains, view.shape))
