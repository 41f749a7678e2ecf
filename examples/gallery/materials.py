# SPDX-License-Identifier: Apache-2.0
"""Tiles of materials: one ball each, under a sky and a lamp."""

import numpy as np
from shapes import at, ball, box, bumps, checker, quad
from stage import Stage
from tiles import tile


def ball_of(device, **material):
    stage = Stage(device)
    stage.daylight()
    stage.ball(**material)
    return stage.picture()


@tile("Materials", "Lambert", "`specular=0`")
def lambert(device):
    return ball_of(device, base_color=(0.7, 0.25, 0.2, 1), specular=0.0)


@tile("Materials", "Oren-Nayar", "`diffuse_roughness=1`: brighter towards its rim")
def oren_nayar(device):
    return ball_of(device, base_color=(0.7, 0.25, 0.2, 1), specular=0.0, diffuse_roughness=1.0)


@tile("Materials", "Glazed", "a dielectric layer, `roughness=0.05`")
def glazed(device):
    return ball_of(device, base_color=(0.7, 0.25, 0.2, 1), roughness=0.05)


@tile("Materials", "Satin", "`roughness=0.4`")
def satin(device):
    return ball_of(device, base_color=(0.7, 0.25, 0.2, 1), roughness=0.4)


@tile("Materials", "Polished gold", "`metallic=1, roughness=0.05`")
def gold(device):
    return ball_of(device, base_color=(1.0, 0.78, 0.34, 1), metallic=1.0, roughness=0.05)


@tile("Materials", "Brushed steel", "`metallic=1, roughness=0.45`")
def steel(device):
    return ball_of(device, base_color=(0.6, 0.6, 0.62, 1), metallic=1.0, roughness=0.45)


@tile("Materials", "Car paint", "metal under a smooth coat: `metallic=1, roughness=0.5, clearcoat=1`")
def car_paint(device):
    return ball_of(device, base_color=(0.55, 0.05, 0.06, 1), metallic=1.0, roughness=0.5, clearcoat=1.0)


@tile("Materials", "Spun metal", "drawn out around the ball: `metallic=1, roughness=0.25, anisotropy=0.8`")
def spun_metal(device):
    return ball_of(device, base_color=(0.7, 0.7, 0.72, 1), metallic=1.0, roughness=0.25, anisotropy=0.8)


@tile("Materials", "Velvet", "fibres over a dark base: `sheen_color`, `sheen_roughness=0.4`")
def velvet(device):
    return ball_of(
        device, base_color=(0.25, 0.02, 0.05, 1), specular=0.0, sheen_color=(1.0, 0.45, 0.5), sheen_roughness=0.4
    )


@tile("Materials", "Tempered steel", "a film of 320 nm: `iridescence=1, iridescence_ior=1.8`")
def tempered_steel(device):
    return ball_of(
        device,
        base_color=(0.6, 0.6, 0.62, 1),
        metallic=1.0,
        roughness=0.2,
        iridescence=1.0,
        iridescence_ior=1.8,
        iridescence_thickness_nm=320.0,
    )


@tile("Materials", "Lampshade", "lets light through: `diffuse_transmission=0.6, thin_walled=True`, a lamp inside")
def lampshade(device):
    stage = Stage(device)
    stage.scene.set_environment((0.15,) * 3, 0.15)
    stage.light("point", (0.0, 0.0, 0.6), intensity=(0.7, 0.6, 0.47), radius_m=0.05)
    stage.ball(
        base_color=(0.8, 0.75, 0.6, 1),
        specular=0.0,
        diffuse_transmission=0.6,
        diffuse_transmission_color=(0.95, 0.7, 0.35),
        thin_walled=True,
    )
    return stage.picture()


@tile("Materials", "Glass", "`transmission=1, ior=1.5`")
def glass(device):
    return ball_of(device, transmission=1.0, roughness=0.0, ior=1.5)


@tile("Materials", "Frosted glass", "`transmission_roughness=0.35` under a smooth surface")
def frosted_glass(device):
    return ball_of(device, transmission=1.0, roughness=0.0, transmission_roughness=0.35)


@tile("Materials", "Tinted glass", "absorbs along the way: `attenuation_color`, `attenuation_distance_m`")
def tinted_glass(device):
    return ball_of(
        device, transmission=1.0, roughness=0.0, attenuation_color=(0.2, 0.75, 0.45), attenuation_distance_m=0.4
    )


@tile(
    "Materials",
    "Window and block",
    "`thin_walled=True`: a sheet with straight light; right, a body that bends it",
)
def window_and_block(device):
    stage = Stage(device)
    stage.scene.set_environment((0.9, 1.0, 1.1))
    for i in range(9):
        post = stage.material(base_color=(0.75, 0.2 + 0.06 * (i % 2), 0.12, 1), specular=0.0)
        stage.add(box((0.035, 0.035, 0.6)), post, at(-1.2 + 0.3 * i, 0.9, 0.6))
    stage.add(
        quad((-0.62, 0.0, 0.48), (0.44, 0.14, 0), (0, 0, 0.48)),
        stage.material(transmission=1.0, roughness=0.0, thin_walled=True),
    )
    stage.add(box((0.44, 0.2, 0.48)), stage.material(transmission=1.0, roughness=0.0), at(0.62, 0.1, 0.481, -0.4))
    stage.options.update(denoise="none", spp=16 * stage.options["spp"])
    return stage.picture()


@tile("Materials", "Wax", "`subsurface=1`: light below the surface, red the farthest")
def wax(device):
    return ball_of(
        device, roughness=0.4, subsurface=1.0, subsurface_color=(0.9, 0.75, 0.5), subsurface_radius_m=(0.2, 0.08, 0.03)
    )


@tile("Materials", "Diamond", "`ior=2.42`")
def diamond(device):
    return ball_of(device, transmission=1.0, roughness=0.0, ior=2.42)


@tile("Materials", "Flint glass", "`dispersion=4`, five times real flint's")
def flint_glass(device):
    return ball_of(device, transmission=1.0, roughness=0.0, ior=1.8, dispersion=4.0)


@tile("Materials", "The paper's mix", '`bsdf="paper"`: diffuse and specular weighted, no layer')
def paper_mix(device):
    return ball_of(device, base_color=(0.25, 0.35, 0.7, 1), metallic=0.5, roughness=0.25, bsdf="paper")


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


@tile("Materials", "Visible", "three paints that differ to the eye ...")
def visible(device):
    return _two_bands(device, "visible")


@tile("Materials", "Infrared", "... and not in the infrared: `ir_albedo`")
def infrared(device):
    return _two_bands(device, "infrared")


def _two_bands(device, band):
    stage = Stage(device)
    stage.daylight()
    for x, colour in ((-0.8, (0.05, 0.05, 0.05, 1)), (0.0, (0.7, 0.1, 0.1, 1)), (0.8, (0.1, 0.2, 0.7, 1))):
        stage.ball(x=x, radius=0.36, base_color=colour, specular=0.0, ir_albedo=0.7)
    stage.options["band"] = band
    return stage.picture()


@tile("Materials", "Per instance", "one mesh, a material each; flattened by its vertices")
def instances(device):
    stage = Stage(device)
    stage.daylight()
    positions, faces, normals, uvs = ball(0.28, squeeze=0.8)
    mesh = stage.scene.add_mesh(positions, faces, normals=normals, uvs=uvs)
    for i in range(5):
        pose = np.eye(4)
        pose[:3, 3] = -1.1 + 0.55 * i, 0.25 * (i % 2), 0.24
        paint = stage.material(base_color=(0.8 - 0.15 * i, 0.25 + 0.1 * i, 0.15 + 0.15 * i, 1), roughness=0.1 + 0.2 * i)
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
