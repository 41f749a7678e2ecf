# SPDX-License-Identifier: Apache-2.0
"""Tiles of lights: two boxes and a ball, one light each."""

import numpy as np

import kuafu
from activestereo.scene_io import solids
from shapes import at, grid, sky, stripes
from stage import MAP_TO_WORLD, Stage
from tiles import tile


def under(name, title, note, ambient=0.0, **light):
    """Adds a tile of boxes and a ball under one light."""

    @tile("Lights", title, note, name)
    def draw(device):
        stage = Stage(device)
        stage.things()
        stage.light(**light)
        if ambient:
            stage.scene.set_environment((ambient,) * 3, ambient)
        return stage.picture()


under("point", "Point", "hard shadows", kind="point", eye=(-1.5, -1.5, 2.2), intensity=(14, 13, 11))
under("sphere", "Glowing sphere", "a point with `radius_m`",
      kind="point", eye=(-1.5, -1.5, 2.2), intensity=(14, 13, 11), radius_m=0.4)  # fmt: skip
under("spot", "Spot", "`inner_rad`, `outer_rad`", 0.05,
      kind="spot", eye=(-1.2, -1.8, 2.6), intensity=(30, 28, 25), inner_rad=0.2, outer_rad=0.3)  # fmt: skip
under("sun", "Directional", "parallel light; shadows soften with `angle_rad`",
      kind="directional", eye=(-3, -2, 4), intensity=(3, 2.8, 2.5), angle_rad=0.06)  # fmt: skip
under("rectangle", "Rectangle", "`size_m`",
      kind="rectangle", eye=(-1.2, -1.6, 2.2), intensity=(12, 12, 12), size_m=(0.9, 0.9))  # fmt: skip


@tile("Lights", "Stained glass", "a rectangle with a texture")
def stained_glass(device):
    stage = Stage(device)
    stage.things()
    window = stage.texture(stripes(), srgb=True)
    glow = {"intensity": (16, 16, 16), "size_m": (1.0, 1.0), "texture": window}
    stage.light("rectangle", (-1.4, -0.6, 1.0), (0.0, 0.3, 0.2), **glow)
    return stage.picture()


under("disk", "Disk", "`radius_m`", kind="disk", eye=(1.4, -1.4, 2.2), intensity=(14, 13, 12), radius_m=0.5)


@tile("Lights", "Environment map", "equirectangular, sampled by its brightness")
def environment(device):
    stage = Stage(device)
    stage.things()
    stage.scene.set_environment((1, 1, 1), texture=stage.texture(sky()), map_to_world=MAP_TO_WORLD)
    return stage.picture()


@tile("Lights", "Projected slide", "a spot with a texture over its cone")
def slide(device):
    stage = Stage(device)
    stage.things()
    stage.scene.set_environment((0.05,) * 3, 0.05)
    cone = {"inner_rad": 0.4, "outer_rad": 0.42, "texture": stage.texture(stripes(), srgb=True)}
    stage.light("spot", (0.3, -2.6, 1.6), (0, 0.5, 0.4), intensity=(22, 22, 22), **cone)
    return stage.picture()


@tile("Lights", "Fog", "`set_medium`: a spot's cone in a scattering medium")
def fog(device):
    stage = Stage(device)
    stage.things()
    stage.light("spot", (-1.6, 0.4, 2.4), (0.2, -0.1, 0.0), intensity=(90, 85, 75), inner_rad=0.14, outer_rad=0.18)
    stage.scene.set_medium(kuafu.Medium(extinction_per_m=(0.25,) * 3, albedo=(0.95,) * 3, phase_g=0.3))
    stage.options.update(denoise="none", spp=12 * stage.options["spp"], max_bounces=3)
    stage.scene.set_environment((0.02, 0.02, 0.03))
    return stage.picture()


def projected(name, title, note, section="Projector", pattern=None, glass=None, options=None, **fields):
    """Adds a tile of infrared dots from beside the camera on boxes and a ball; `glass` puts them behind a pane."""

    @tile(section, title, note, name)
    def draw(device):
        stage = Stage(device)
        stage.things()
        if glass is not None:
            pane = stage.material(
                transmission=1.0, roughness=0.0, attenuation_color=(0.3, 0.6, 0.5), attenuation_distance_m=0.05
            )
            stage.add(solids.box(), pane, at(0.0, -0.9, 0.5, 0.15, (0.6, 0.01, 0.5)))
            stage.options["glass_surfaces"] = glass
        stage.options.update(band="infrared", ir_ambient_radiance=0.01, **(options or {}))
        stage.projector(**fields, **({} if pattern is None else {"texture": stage.texture(pattern)}))
        return stage.picture()


places = np.stack(np.meshgrid(np.arange(4, 160, 8.0), np.arange(4, 160, 8.0)), -1).reshape(-1, 2)
places[:, 0] += 2.0 * np.sin(places[:, 1])  # anywhere, not only where an image has pixels
power = np.where(np.arange(len(places)) % 5, 6.0, 24.0)
projected("dots_sharp", "Dots", "an image through K, in the infrared")
projected("dots_listed", "A list of dots", "`dots`: place and power; every fifth is four times as bright",
          dots=np.column_stack([places, power]), pattern_width=160, pattern_height=160, dot_sigma_px=0.7)  # fmt: skip
projected("dots_defocused", "Out of focus", "blur grows away from `focus_m`", focus_m=1.2, radius_m=0.03)
projected("dots_distorted", "Distorted", "Brown and Conrady's polynomial",
          pattern=grid(), distortion=(-0.9, 0.5, 0, 0, 0, 0, 0, 0))  # fmt: skip
projected("dots_falloff", "Falloff", "`falloff`: cos^n of the angle from its axis", falloff=40.0)
projected("dots_through_glass", "Through glass", "shadow rays pass smooth glass (`glass_surfaces=8`) ...", glass=8)
projected("dots_blocked", "Blocked by glass", "... or glass casts a shadow (`glass_surfaces=0`)", glass=0)


@tile("Projector", "Bent by glass", '`glass_shadows="bent"`: a ball turns and gathers dots')
def dots_bent(device):
    stage = Stage(device, wall=False)
    stage.camera.update(eye=(0.0, -2.6, 1.9), target=(0.0, -0.2, 0.2))
    stage.ball(x=0.0, y=0.2, radius=0.4, transmission=1.0, roughness=0.0)
    stage.options.update(band="infrared", ir_ambient_radiance=0.02, glass_shadows="bent")
    stage.projector((0.6, 1.9, 2.2), (0.0, 0.0, 0.1), 40.0)
    return stage.picture()
