# SPDX-License-Identifier: Apache-2.0
"""Tiles of what one render call can return, all of one scene."""

import numpy as np
from shapes import at
from stage import Stage, to_srgb
from tiles import tile


def furnished(device):
    stage = Stage(device)
    stage.things(roughness=0.3)
    stage.options.update(band="infrared", ir_ambient_radiance=0.0)
    stage.scene.set_environment((0.12,) * 3, 0.12)
    stage.projector()
    return stage


def light_of(output, title, note, gain=1.0):
    """Adds a tile of an output that is light or a share of it."""

    @tile("Outputs", title, note, output)
    def draw(device):
        return to_srgb(gain * furnished(device).render(output)[0])


def colours_of(output, name, title):
    """Adds a tile of an output of ids: a colour per id, black where there is none."""

    @tile("Outputs", title, f"`{output}`", name)
    def draw(device):
        ids = furnished(device).render(output)[0].astype(np.int64)
        palette = np.random.default_rng(7).integers(60, 255, (64, 3)).astype(np.uint8)
        return np.where(ids == 0xFFFFFFFF, 0, palette[ids[..., 0] % 64]).astype(np.uint8)


light_of("radiance", "Radiance", "`radiance`: the sum of all light")
light_of("projector_direct", "Projector, direct", "`projector_direct`: dots without Monte Carlo noise")
light_of("projector_indirect", "Projector, indirect", "`projector_indirect`, four times as bright", 4.0)
light_of("ambient", "Ambient", "`ambient`: every other light")
light_of("ambient_direct", "Ambient, direct", "`ambient_direct`: without bounced light, not denoised")


@tile("Outputs", "Depth", "`depth`: z in metres, near is bright")
def depth(device):
    (z,) = furnished(device).render("depth")
    return to_srgb(np.where(z > 0, np.clip((5.5 - z) / 3.5, 0, 1), 0))


@tile("Outputs", "Normals", "`normal`: shading normals of the world")
def normals(device):
    return np.round(127.5 * (furnished(device).render("normal")[0] + 1)).astype(np.uint8)


colours_of("instance_id", "instance_ids", "Instances")
colours_of("material_id", "material_ids", "Materials")
light_of("albedo", "Albedo", "`albedo`: base colour in the band")


@tile("Outputs", "Projector's pixel", "`projector_uv` as red and green, where `projector_visibility` is 1")
def projector_pixel(device):
    uv, visibility = furnished(device).render("projector_uv", "projector_visibility")
    colour = np.concatenate([uv / 160, np.full_like(uv[..., :1], 0.3)], -1)
    return to_srgb(np.where(visibility > 0, np.nan_to_num(colour), 0.0))


@tile("Outputs", "Motion", "`motion`: pixels since the last frame")
def motion(device):
    stage = furnished(device)
    balls = {stage.ball(x, -0.9, 0.2): x for x in (-0.4, 0.5)}
    stage.scene.next_frame()
    for thing, x in balls.items():
        stage.scene.set_instance_pose(thing, at(0.7 * x, -0.9, 0.2))
    pixels, still = (stage.render(name)[0][..., 0] for name in ("motion", "albedo"))
    still = 0.15 * still
    return to_srgb(
        np.stack([still + 0.04 * np.clip(pixels, 0, None), still, still - 0.04 * np.clip(pixels, None, 0)], -1)
    )


@tile("Outputs", "Variance", "`variance` of each pixel's mean; its root, over the light")
def variance(device):
    stage = furnished(device)
    stage.options.update(spp=16, denoise="none")
    spread, light = stage.render("variance", "radiance")
    return to_srgb(np.sqrt(spread) / np.maximum(light, 1e-6))
