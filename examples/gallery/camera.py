# SPDX-License-Identifier: Apache-2.0
"""Tiles of the camera: its lens, and what moves while the shutter is open."""

import numpy as np
from shapes import at, ball, box, checker
from stage import Stage
from tiles import tile


def seen_by(device, **fields):
    """Boxes and a ball under a sky, by a camera with these fields."""
    stage = Stage(device)
    stage.daylight()
    stage.boxes()
    stage.ball(y=-0.2, radius=0.35, roughness=0.2)
    stage.camera_fields = fields
    return stage.picture()


@tile("Camera", "Distorting lens", "Brown and Conrady: `distortion`")
def lens_distortion(device):
    return seen_by(device, distortion=(-0.9, 0.6, 0, 0, 0, 0, 0, 0))


@tile("Camera", "Thin lens", "`lens_radius_m`, `focus_m`: blur out of focus")
def thin_lens(device):
    return seen_by(device, lens_radius_m=0.12, focus_m=3.1)


@tile("Camera", "Motion blur", "`exposure_s` with a moving camera: `linear_velocity`")
def motion_blur(device):
    return seen_by(device, exposure_s=0.1, linear_velocity=(2.0, 0.0, 0.0))


@tile("Camera", "Rolling shutter", "rows in turn: `line_time_s`")
def rolling_shutter(device):
    return seen_by(device, shutter="rolling", line_time_s=0.002, linear_velocity=(2.5, 0.0, 0.0))


@tile("Camera", "Things that move", "one slides, one spins: `linear_velocity` and `angular_velocity` of an instance")
def moving_things(device):
    stage = Stage(device)
    stage.daylight()
    stage.add(
        ball(0.35),
        stage.material(base_color=(0.7, 0.3, 0.2, 1), specular=0.0),
        at(-0.75, 0.0, 0.35),
        linear_velocity=(4.0, 0.0, 0.0),
    )
    squares = stage.material(specular=0.0, base_color_texture=stage.texture(checker(4), srgb=True))
    stage.add(box((0.34, 0.34, 0.34)), squares, at(0.75, 0.1, 0.34), angular_velocity=(0.0, 0.0, np.deg2rad(250)))
    stage.camera_fields = {"exposure_s": 0.1}
    return stage.picture()
