# SPDX-License-Identifier: Apache-2.0
"""Tiles of materials: one ball each, under a sky and a lamp."""

import numpy as np

from activestereo.scene_io import meshes, solids
from activestereo.scene_io.bodies import add_mesh
from shapes import at, bumps, checker
from stage import Stage
from tiles import tile

RED = (0.7, 0.25, 0.2, 1)


def ball_of(name, title, note, **material):
    """Adds a tile of one ball of a material with these fields."""

    @tile("Materials", title, note, name)
    def draw(device):
        stage = Stage(device)
        stage.daylight()
        stage.ball(**material)
        return stage.picture()


ball_of("lambert", "Lambert", "`specular=0`", base_color=RED, specular=0.0)
ball_of("oren_nayar", "Oren-Nayar", "`diffuse_roughness=1`: brighter towards its rim",
        base_color=RED, specular=0.0, diffuse_roughness=1.0)  # fmt: skip
ball_of("glazed", "Glazed", "a dielectric layer, `roughness=0.05`", base_color=RED, roughness=0.05)
ball_of("satin", "Satin", "`roughness=0.4`", base_color=RED, roughness=0.4)
ball_of("gold", "Polished gold", "`metallic=1, roughness=0.05`",
        base_color=(1.0, 0.78, 0.34, 1), metallic=1.0, roughness=0.05)  # fmt: skip
ball_of("steel", "Brushed steel", "`metallic=1, roughness=0.45`",
        base_color=(0.6, 0.6, 0.62, 1), metallic=1.0, roughness=0.45)  # fmt: skip
ball_of("car_paint", "Car paint", "metal under a smooth coat: `metallic=1, roughness=0.5, clearcoat=1`",
        base_color=(0.55, 0.05, 0.06, 1), metallic=1.0, roughness=0.5, clearcoat=1.0)  # fmt: skip
ball_of("spun_metal", "Spun metal", "drawn out around the ball: `metallic=1, roughness=0.25, anisotropy=0.8`",
        base_color=(0.7, 0.7, 0.72, 1), metallic=1.0, roughness=0.25, anisotropy=0.8)  # fmt: skip
ball_of("velvet", "Velvet", "fibres over a dark base: `sheen_color`, `sheen_roughness=0.4`",
        base_color=(0.25, 0.02, 0.05, 1), specular=0.0, sheen_color=(1.0, 0.45, 0.5), sheen_roughness=0.4)  # fmt: skip
ball_of("tempered_steel", "Tempered steel", "a film of 320 nm: `iridescence=1, iridescence_ior=1.8`",
        base_color=(0.6, 0.6, 0.62, 1), metallic=1.0, roughness=0.2,
        iridescence=1.0, iridescence_ior=1.8, iridescence_thickness_nm=320.0)  # fmt: skip


@tile("Materials", "Lampshade", "lets light through: `diffuse_transmission=0.6, thin_walled=True`, a lamp inside")
def lampshade(device):
    stage = Stage(device)
    stage.scene.set_environment((0.15,) * 3, 0.15)
    stage.light("point", (0.0, 0.0, 0.6), (0.0, 1.0, 0.6), intensity=(0.7, 0.6, 0.47), radius_m=0.05)
    stage.ball(
        base_color=(0.8, 0.75, 0.6, 1),
        specular=0.0,
        diffuse_transmission=0.6,
        diffuse_transmission_color=(0.95, 0.7, 0.35),
        thin_walled=True,
    )
    return stage.picture()


ball_of("glass", "Glass", "`transmission=1, ior=1.5`", transmission=1.0, roughness=0.0, ior=1.5)
ball_of("frosted_glass", "Frosted glass", "`transmission_roughness=0.35` under a smooth surface",
        transmission=1.0, roughness=0.0, transmission_roughness=0.35)  # fmt: skip
ball_of("tinted_glass", "Tinted glass", "absorbs along the way: `attenuation_color`, `attenuation_distance_m`",
        transmission=1.0, roughness=0.0, attenuation_color=(0.2, 0.75, 0.45), attenuation_distance_m=0.4)  # fmt: skip


@tile("Materials", "Window and block", "`thin_walled=True`: a sheet with straight light; right, a body that bends it")
def window_and_block(device):
    stage = Stage(device)
    stage.scene.set_environment((0.9, 1.0, 1.1))
    for i in range(9):
        post = stage.material(base_color=(0.75, 0.2 + 0.06 * (i % 2), 0.12, 1), specular=0.0)
        stage.add(solids.box(), post, at(-1.2 + 0.3 * i, 0.9, 0.6, size=(0.035, 0.035, 0.6)))
    pane = meshes.sheet((-1.06, -0.14, 0.0), (0.88, 0.28, 0.0), (0.0, 0.0, 0.96))
    stage.add(pane, stage.material(transmission=1.0, roughness=0.0, thin_walled=True))
    block = at(0.62, 0.1, 0.481, -0.4, (0.44, 0.2, 0.48))
    stage.add(solids.box(), stage.material(transmission=1.0, roughness=0.0), block)
    stage.options.update(denoise="none", spp=16 * stage.options["spp"])
    return stage.picture()


ball_of("wax", "Wax", "`subsurface=1`: light below the surface, red the farthest", roughness=0.4, subsurface=1.0,
        subsurface_color=(0.9, 0.75, 0.5), subsurface_radius_m=(0.2, 0.08, 0.03))  # fmt: skip
ball_of("diamond", "Diamond", "`ior=2.42`", transmission=1.0, roughness=0.0, ior=2.42)
ball_of("flint_glass", "Flint glass", "`dispersion=4`, five times real flint's",
        transmission=1.0, roughness=0.0, ior=1.8, dispersion=4.0)  # fmt: skip
ball_of("paper_mix", "The paper's mix", '`bsdf="paper"`: diffuse and specular weighted, no layer',
        base_color=(0.25, 0.35, 0.7, 1), metallic=0.5, roughness=0.25, bsdf="paper")  # fmt: skip


@tile("Materials", "Colour and normal textures", "sRGB colour, tangent-space normals")
def textured(device):
    stage = Stage(device)
    stage.daylight()
    colour = stage.texture(np.stack([checker(16, 90, 230), checker(16, 60, 120), checker(16, 40, 60)], -1), srgb=True)
    stage.ball(base_color_texture=colour, normal_texture=stage.texture(bumps()), roughness=0.3)
    return stage.picture()


@tile("Materials", "Glowing", "`emission`: its surface is a sampled light")
def glowing(device):
    stage = Stage(device)
    stage.scene.set_environment((0.02, 0.02, 0.03), 0.02)
    stage.ball(emission=(3.0, 1.6, 0.5), ir_emission=2.0, specular=0.0)
    stage.boxes()
    return stage.picture()


def in_band(band, title, note):
    """Adds a tile of three paints in this band."""

    @tile("Materials", title, note, band)
    def draw(device):
        stage = Stage(device)
        stage.daylight()
        for x, colour in ((-0.8, (0.05, 0.05, 0.05, 1)), (0.0, (0.7, 0.1, 0.1, 1)), (0.8, (0.1, 0.2, 0.7, 1))):
            stage.ball(x=x, radius=0.36, base_color=colour, specular=0.0, ir_albedo=0.7)
        stage.options["band"] = band
        return stage.picture()


in_band("visible", "Visible", "three paints that differ to the eye ...")
in_band("infrared", "Infrared", "... and not in the infrared: `ir_albedo`")


@tile("Materials", "Per instance", "one mesh, a material each; flattened by their poses")
def instances(device):
    stage = Stage(device)
    stage.daylight()
    mesh = add_mesh(stage.scene, solids.sphere())
    for i in range(5):
        paint = stage.material(base_color=(0.8 - 0.15 * i, 0.25 + 0.1 * i, 0.15 + 0.15 * i, 1), roughness=0.1 + 0.2 * i)
        pose = at(-1.1 + 0.55 * i, 0.25 * (i % 2), 0.24, size=(0.28, 0.28, 0.224))
        stage.scene.add_instance(mesh, [paint], local_to_world=pose)
    return stage.picture()


def beside_a_lamp(device):
    """A lamp at the side throws a long hard shadow over the table, which the camera sees from above."""
    stage = Stage(device)
    stage.scene.set_environment((0.12,) * 3, 0.12)
    stage.light("point", (-1.5, -1.1, 2.2), intensity=(18, 18, 18))
    stage.camera = {"eye": (0.35, -2.6, 2.0), "target": (0.3, 0.0, 0.25), "focal": 230.0}
    stage.options |= {"denoise": "none", "spp": 6 * stage.options["spp"]}
    return stage


@tile("Materials", "Cut out", '`alpha_mode="mask"`: holes for camera, light and shadow')
def cut_out(device):
    stage = beside_a_lamp(device)
    alpha = np.kron(checker(12, 0, 255), np.ones((4, 4), np.uint8))
    colour = np.dstack([np.full_like(alpha, value) for value in (200, 90, 45)] + [alpha])
    stage.ball(base_color_texture=stage.texture(colour, srgb=True), alpha_mode="mask", specular=0.0)
    return stage.picture()


@tile("Materials", "Half there", '`alpha_mode="blend"`, alpha 0.4: with a thin shadow')
def half_there(device):
    stage = beside_a_lamp(device)
    stage.ball(base_color=(0.1, 0.45, 0.8, 0.4), alpha_mode="blend", specular=0.0)
    return stage.picture()
