# SPDX-License-Identifier: Apache-2.0
"""Tiles of the denoiser: few samples, filtered, and many."""

from lights import projected
from stage import Stage
from tiles import tile


def at_samples(device, spp, denoise):
    stage = Stage(device)
    stage.daylight()
    stage.boxes()
    stage.ball(y=-0.2, radius=0.35, transmission=1.0, roughness=0.0)
    stage.options.update(spp=spp, denoise=denoise)
    return stage.picture()


@tile("Denoising", "2 samples", "as they are")
def noisy(device):
    return at_samples(device, 2, "none")


@tile("Denoising", "2 samples, denoised", '`denoise="atrous"`')
def denoised(device):
    return at_samples(device, 2, "atrous")


@tile("Denoising", "Dots, 2 samples", "as they are")
def dots_noisy(device):
    return projected(device, options={"spp": 2, "denoise": "none"})


@tile("Denoising", "Dots, 2 samples, denoised", "the projector's direct light is left alone")
def dots_denoised(device):
    return projected(device, options={"spp": 2})
