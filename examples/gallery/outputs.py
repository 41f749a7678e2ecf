# SPDX-License-Identifier: Apache-2.0
"""Tiles of what one render call can return, all of one scene."""

import numpy as np
from shapes import at, dots
from stage import Stage, to_srgb
from tiles import tile


def furnished(device):
    stage = Stage(device)
    stage.boxes()
    stage.ball(y=-0.2, radius=0.35, roughness=0.3)
    stage.options.update(band="infrared", ir_ambient_radiance=0.0)
    stage.scene.set_environment((0.12,) * 3, 0.12)
    k = [[150, 0, 79.5], [0, 150, 79.5], [0, 0, 1]]
    stage.light("projector", (0.25, -3.0, 1.2), (0, 0.3, 0.45), ir_intensity=24.0, k=k, texture=stage.texture(dots()))
    return stage


def colours_of(ids):
    """A colour per id, black where there is none."""
    ids = ids[..., 0].astype(np.int64)
    palette = np.random.default_rng(7).integers(60, 255, (64, 3)).astype(np.uint8)
    return np.where((ids == 0xFFFFFFFF)[..., None], 0, palette[ids % 64]).astype(np.uint8)


@tile("Outputs", "Radiance", "`radiance`: the sum of all light")
def radiance(device):
    return furnished(device).picture()


def _group(device, output, gain):
    return to_srgb(gain * furnished(device).render(output))


@tile("Outputs", "Projector, direct", "`projector_direct`: dots without Monte Carlo noise")
def projector_direct(device):
    return _group(device, "projector_direct", 1.0)


@tile("Outputs", "Projector, indirect", "`projector_indirect`, four times as bright")
def projector_indirect(device):
    return _group(device, "projector_indirect", 4.0)


@tile("Outputs", "Ambient", "`ambient`: every other light")
def ambient(device):
    return _group(device, "ambient", 1.0)


@tile("Outputs", "Depth", "`depth`: z in metres, near is bright")
def depth(device):
    z = furnished(device).render("depth")
    return to_srgb(np.where(z > 0, np.clip((5.5 - z) / 3.5, 0, 1), 0))


@tile("Outputs", "Normals", "`normal`: shading normals of the world")
def normals(device):
    return np.round(127.5 * (furnished(device).render("normal") + 1)).astype(np.uint8)


@tile("Outputs", "Instances", "`instance_id`")
def instance_ids(device):
    return colours_of(furnished(device).render("instance_id"))


@tile("Outputs", "Materials", "`material_id`")
def material_ids(device):
    return colours_of(furnished(device).render("material_id"))


@tile("Outputs", "Albedo", "`albedo`: base colour in the band")
def albedo(device):
    return _group(device, "albedo", 1.0)


@tile("Outputs", "Projector's pixel", "`projector_uv` as red and green, where `projector_visibility` is 1")
def projector_pixel(device):
    stage = furnished(device)
    images = stage.renderer.render(stage.scene, stage.view(), ["projector_uv", "projector_visibility"], **stage.options)
    colour = np.concatenate(
        [images["projector_uv"][0] / 160, np.full((*images["projector_uv"].shape[1:3], 1), 0.3)], -1
    )
    return to_srgb(np.where(images["projector_visibility"][0] > 0, np.nan_to_num(colour), 0.0))


@tile("Outputs", "Motion", "`motion`: pixels since the last frame")
def motion(device):
    stage = furnished(device)
    balls = {thing: x for x in (-0.4, 0.5) for thing in [stage.ball(x, -0.9, 0.2)[1]]}
    stage.scene.next_frame()
    for thing, x in balls.items():
        stage.scene.set_instance_pose(thing, at(0.7 * x, -0.9, 0.2))
    pixels = stage.render("motion")[..., 0]
    still = 0.15 * stage.render("albedo")[..., 0]
    return to_srgb(
        np.stack([still + 0.04 * np.clip(pixels, 0, None), still, still - 0.04 * np.clip(pixels, None, 0)], -1)
    )


@tile("Outputs", "Variance", "`variance` of each pixel's mean; its root, over the light")
def variance(device):
    stage = furnished(device)
    stage.options.update(spp=16, denoise="none")
    images = stage.renderer.render(stage.scene, stage.view(), ["variance", "radiance"], **stage.options)
    return to_srgb(np.sqrt(images["variance"][0]) / np.maximum(images["radiance"][0], 1e-6))
