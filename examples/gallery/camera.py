# SPDX-License-Identifier: Apache-2.0
"""Tiles of the camera: its lens, and what moves while the shutter is open."""

import numpy as np

from activestereo.scene_io import solids
from shapes import at, checker
from stage import Stage
from tiles import tile


def seen_by(name, title, note, **fields):
    """Adds a tile of boxes and a ball under a sky, by a camera with these fields."""

    @tile("Camera", title, note, name)
    def draw(device):
        stage = Stage(device)
        stage.daylight()
        stage.things(roughness=0.2)
        stage.camera_fields = fields
        return stage.picture()


seen_by("lens_distortion", "Distorting lens", "Brown and Conrady: `distortion`",
        distortion=(-0.9, 0.6, 0, 0, 0, 0, 0, 0))  # fmt: skip
seen_by("thin_lens", "Thin lens", "`lens_radius_m`, `focus_m`: blur out of focus", lens_radius_m=0.12, focus_m=3.1)
seen_by("motion_blur", "Motion blur", "`exposure_s` with a moving camera: `linear_velocity`",
        exposure_s=0.1, linear_velocity=(2.0, 0.0, 0.0))  # fmt: skip
seen_by("rolling_shutter", "Rolling shutter", "rows in turn: `line_time_s`",
        shutter="rolling", line_time_s=0.002, linear_velocity=(2.5, 0.0, 0.0))  # fmt: skip


@tile("Camera", "Things that move", "one slides, one spins: `linear_velocity` and `angular_velocity` of an instance")
def moving_things(device):
    stage = Stage(device)
    stage.daylight()
    paint = stage.material(base_color=(0.7, 0.3, 0.2, 1), specular=0.0)
    stage.add(solids.sphere(), paint, at(-0.75, 0.0, 0.35, size=(0.35,) * 3), linear_velocity=(4.0, 0.0, 0.0))
    squares = stage.material(specular=0.0, base_color_texture=stage.texture(checker(4), srgb=True))
    place = at(0.75, 0.1, 0.34, size=(0.34,) * 3)
    stage.add(solids.box(), squares, place, angular_velocity=(0.0, 0.0, np.deg2rad(250)))
    stage.camera_fields = {"exposure_s": 0.1}
    return stage.picture()
