# SPDX-License-Identifier: Apache-2.0
"""Tiles of what stands between the light and the image: the camera's optics."""

import kuafu
from stage import Stage
from tiles import tile


def developed(name, title, note, **optics):
    """Adds a tile of boxes and a golden ball through optics with these fields."""

    @tile("Optics", title, note, name)
    def draw(device):
        stage = Stage(device)
        stage.daylight()
        stage.things(base_color=(1.0, 0.78, 0.34, 1), metallic=1.0, roughness=0.1)
        if optics:
            stage.options["optics"] = kuafu.Optics(**optics)
        return stage.picture()


developed("pinhole", "Pinhole", "nothing in the way")
developed("vignetting", "Vignetting", "cos^n and a polynomial of the radius", vignetting_exponent=16.0)
developed("point_spread", "Point spread", "a Gaussian, wider in the corners", psf_sigma_px=0.6, psf_corner_sigma_px=4.0)
developed("defocus", "Defocus by depth", "circle of confusion from each pixel's depth",
          defocus_lens_radius_m=0.06, defocus_focus_m=3.0)  # fmt: skip
developed("veiling_glare", "Veiling glare", "an even share of all light", veiling_glare_fraction=0.35)
