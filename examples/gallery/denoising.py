# SPDX-License-Identifier: Apache-2.0
"""Tiles of the denoiser: few samples, filtered, and many."""

from lights import projected
from stage import Stage
from tiles import tile


def at_two_samples(name, title, note, denoise):
    """Adds a tile of a glass ball between boxes, at 2 samples per pixel."""

    @tile("Denoising", title, note, name)
    def draw(device):
        stage = Stage(device)
        stage.daylight()
        stage.things(transmission=1.0, roughness=0.0)
        stage.options.update(spp=2, denoise=denoise)
        return stage.picture()


at_two_samples("noisy", "2 samples", "as they are", "none")
at_two_samples("denoised", "2 samples, denoised", '`denoise="atrous"`', "atrous")
projected("dots_noisy", "Dots, 2 samples", "as they are", "Denoising", options={"spp": 2, "denoise": "none"})
projected("dots_denoised", "Dots, 2 samples, denoised", "the projector's direct light is left alone", "Denoising",
          options={"spp": 2})  # fmt: skip
