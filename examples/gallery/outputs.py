"""Tiles of what one render call can return, all of one scene."""

import numpy as np
from shapes import dots
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
