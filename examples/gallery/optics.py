# SPDX-License-Identifier: Apache-2.0
"""Tiles of what stands between the light and the image: the camera's optics."""

import kuafu
from stage import Stage
from tiles import tile


def developed(device, **optics):
    stage = Stage(device)
    stage.daylight()
    stage.boxes()
    stage.ball(y=-0.2, radius=0.35, base_color=(1.0, 0.78, 0.34, 1), metallic=1.0, roughness=0.1)
    if optics:
        stage.options["optics"] = kuafu.Optics(**optics)
    return stage.picture()


@tile("Optics", "Pinhole", "nothing in the way")
def pinhole(device):
    return developed(device)


@tile("Optics", "Vignetting", "cos^n and a polynomial of the radius")
def vignetting(device):
    return developed(device, vignetting_exponent=16.0)


@tile("Optics", "Point spread", "a Gaussian, wider in the corners")
def point_spread(device):
    return developed(device, psf_sigma_px=0.6, psf_corner_sigma_px=4.0)


@tile("Optics", "Defocus by depth", "circle of confusion from each pixel's depth")
def defocus(device):
    return developed(device, defocus_lens_radius_m=0.06, defocus_focus_m=3.0)


@tile("Optics", "Veiling glare", "an even share of all light")
def veiling_glare(device):
    return developed(device, veiling_glare_fraction=0.35)
