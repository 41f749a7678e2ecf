# SPDX-License-Identifier: Apache-2.0
"""Tiles of lights: two boxes and a ball, one light each."""

import numpy as np

import kuafu
from shapes import at, box, dots, grid, sky, stripes
from stage import MAP_TO_WORLD, Stage
from tiles import tile


def under(device, *, exposure=1.0, ambient=0.0, **light):
    """Boxes and a ball under one light."""
    stage = Stage(device)
    stage.exposure = exposure
    stage.boxes()
    stage.ball(y=-0.2, radius=0.35)
    if light:
        stage.light(**light)
    if ambient:
        stage.scene.set_environment((ambient,) * 3, ambient)
    return stage


@tile("Lights", "Point", "hard shadows")
def point(device):
    return under(device, kind="point", eye=(-1.5, -1.5, 2.2), intensity=(14, 13, 11)).picture()


@tile("Lights", "Glowing sphere", "a point with `radius_m`")
def sphere(device):
    return under(device, kind="point", eye=(-1.5, -1.5, 2.2), intensity=(14, 13, 11), radius_m=0.4).picture()


@tile("Lights", "Spot", "`inner_rad`, `outer_rad`")
def spot(device):
    return under(
        device, ambient=0.05, kind="spot", eye=(-1.2, -1.8, 2.6), intensity=(30, 28, 25), inner_rad=0.2, outer_rad=0.3
    ).picture()


@tile("Lights", "Directional", "parallel light; shadows soften with `angle_rad`")
def sun(device):
    return under(device, kind="directional", eye=(-3, -2, 4), intensity=(3, 2.8, 2.5), angle_rad=0.06).picture()


@tile("Lights", "Rectangle", "`size_m`")
def rectangle(device):
    return under(device, kind="rectangle", eye=(-1.2, -1.6, 2.2), intensity=(12, 12, 12), size_m=(0.9, 0.9)).picture()


@tile("Lights", "Stained glass", "a rectangle with a texture")
def stained_glass(device):
    stage = under(device)
    stage.light(
        "rectangle",
        (-1.4, -0.6, 1.0),
        (0.0, 0.3, 0.2),
        intensity=(16, 16, 16),
        size_m=(1.0, 1.0),
        texture=stage.texture(stripes(), srgb=True),
    )
    return stage.picture()


@tile("Lights", "Disk", "`radius_m`")
def disk(device):
    return under(device, kind="disk", eye=(1.4, -1.4, 2.2), intensity=(14, 13, 12), radius_m=0.5).picture()


@tile("Lights", "Environment map", "equirectangular, sampled by its brightness")
def environment(device):
    stage = under(device)
    stage.scene.set_environment((1, 1, 1), texture=stage.texture(sky()), map_to_world=MAP_TO_WORLD)
    return stage.picture()


@tile("Lights", "Projected slide", "a spot with a texture over its cone")
def slide(device):
    stage = under(device, ambient=0.05)
    stage.light(
        "spot",
        (0.3, -2.6, 1.6),
        (0, 0.5, 0.4),
        intensity=(22, 22, 22),
        inner_rad=0.4,
        outer_rad=0.42,
        texture=stage.texture(stripes(), srgb=True),
    )
    return stage.picture()


@tile("Lights", "Fog", "`set_medium`: a spot's cone in a scattering medium")
def fog(device):
    stage = under(device)
    stage.light("spot", (-1.6, 0.4, 2.4), (0.2, -0.1, 0.0), intensity=(90, 85, 75), inner_rad=0.14, outer_rad=0.18)
    stage.scene.set_medium(kuafu.Medium(extinction_per_m=(0.25,) * 3, albedo=(0.95,) * 3, phase_g=0.3))
    stage.options.update(denoise="none", spp=12 * stage.options["spp"], max_bounces=3)
    stage.scene.set_environment((0.02, 0.02, 0.03))
    return stage.picture()


def projected(device, *, pattern=None, glass=None, options=None, **fields):
    """Infrared dots from beside the camera on the boxes and the ball; or all of that behind a window pane."""
    stage = Stage(device)
    stage.boxes()
    stage.ball(y=-0.2, radius=0.35)
    if glass is not None:
        pane = stage.material(
            transmission=1.0, roughness=0.0, attenuation_color=(0.3, 0.6, 0.5), attenuation_distance_m=0.05
        )
        stage.add(box((0.6, 0.01, 0.5)), pane, at(0.0, -0.9, 0.5, 0.15))
        stage.options["glass_surfaces"] = glass
    stage.options.update(band="infrared", ir_ambient_radiance=0.01, **(options or {}))
    k = [[150, 0, 79.5], [0, 150, 79.5], [0, 0, 1]]
    if "dots" not in fields:
        fields["texture"] = stage.texture(dots() if pattern is None else pattern)
    stage.light("projector", (0.25, -3.0, 1.2), (0, 0.3, 0.45), ir_intensity=24.0, k=k, **fields)
    return stage.picture()


@tile("Projector", "Dots", "an image through K, in the infrared")
def dots_sharp(device):
    return projected(device)


@tile("Projector", "A list of dots", "`dots`: place and power; every fifth is four times as bright")
def dots_listed(device):
    places = np.stack(np.meshgrid(np.arange(4, 160, 8.0), np.arange(4, 160, 8.0)), -1).reshape(-1, 2)
    places[:, 0] += 2.0 * np.sin(places[:, 1])  # anywhere, not only where an image has pixels
    power = np.where(np.arange(len(places)) % 5, 6.0, 24.0)
    return projected(
        device, dots=np.column_stack([places, power]), pattern_width=160, pattern_height=160, dot_sigma_px=0.7
    )


@tile("Projector", "Out of focus", "blur grows away from `focus_m`")
def dots_defocused(device):
    return projected(device, focus_m=1.2, radius_m=0.03)


@tile("Projector", "Distorted", "Brown and Conrady's polynomial")
def dots_distorted(device):
    return projected(device, pattern=grid(), distortion=(-0.9, 0.5, 0, 0, 0, 0, 0, 0))


@tile("Projector", "Falloff", "`falloff`: cos^n of the angle from its axis")
def dots_falloff(device):
    return projected(device, falloff=40.0)


@tile("Projector", "Through glass", "shadow rays pass smooth glass (`glass_surfaces=8`) ...")
def dots_through_glass(device):
    return projected(device, glass=8)


@tile("Projector", "Blocked by glass", "... or glass casts a shadow (`glass_surfaces=0`)")
def dots_blocked(device):
    return projected(device, glass=0)


@tile("Projector", "Bent by glass", '`glass_shadows="bent"`: a ball turns and gathers dots')
def dots_bent(device):
    stage = Stage(device, wall=False)
    stage.camera.update(eye=(0.0, -2.6, 1.9), target=(0.0, -0.2, 0.2))
    stage.ball(x=0.0, y=0.2, radius=0.4, transmission=1.0, roughness=0.0)
    stage.options.update(band="infrared", ir_ambient_radiance=0.02, glass_shadows="bent")
    k = [[150, 0, 79.5], [0, 150, 79.5], [0, 0, 1]]
    stage.light("projector", (0.6, 1.9, 2.2), (0.0, 0.0, 0.1), ir_intensity=40.0, k=k, texture=stage.texture(dots()))
    return stage.picture()
