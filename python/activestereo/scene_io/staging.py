# SPDX-License-Identifier: Apache-2.0
"""Converts lamps of scene files to radiometric units and infrared light, and reads environment maps.

Scene files state photometric units: candela and lux (KHR_lights_punctual), nits (UsdLux). Divided by LUMENS_PER_WATT
they are visible light in W/sr, W/m^2 and W/(sr m^2). A camera's `ir_ambient_scale` is the share of a white LED's
visible light that its infrared imagers count. For other lamps of equal visible light, INFRARED_SHARES multiplies this
share. Environment maps are Radiance HDR and OpenEXR in linear radiance, PNG and JPEG in sRGB."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from activestereo.common import srgb
from activestereo.common.input_files import checked_file
from activestereo.common.shown import unknown

if TYPE_CHECKING:
    import kuafu


# Luminous efficacy at 540 THz, which defines the candela (SI brochure, 9th edition, section 2.3.1). Blender's exporter
# multiplies its watts by it.
LUMENS_PER_WATT = 683.0

# Counts of an unfiltered silicon imager per lumen, over those of a white LED of 300 lm/W (Murphy, J. Appl. Phys. 111,
# 2012). Glowing lamps follow Planck's law at the stated temperature; the imager's quantum efficiency is even to 600 nm
# and falls to 0 at 1050 nm. Fluorescent lamps, like LEDs, send next to nothing beyond 700 nm.
INFRARED_SHARES = {
    "led": 1.0,
    "fluorescent": 1.0,
    "sun": 1.6,  # 5778 K
    "halogen": 2.9,  # 3000 K
    "incandescent": 3.6,  # 2700 K
    "candle": 9.6,  # 1900 K
}


def infrared_share(kind: str) -> float:
    """Returns the infrared share of a kind of lamp, or the number in the text. Raises ValueError with the known
    kinds."""
    try:
        share = INFRARED_SHARES[kind] if kind in INFRARED_SHARES else float(kind)
    except ValueError:
        raise ValueError(unknown("lamp", kind, INFRARED_SHARES) + ", or a number of at least 0") from None
    if not 0.0 <= share < 1e6:
        raise ValueError(f"the infrared share of a lamp is {share:g}, it must be at least 0 and below 1e6")
    return share


def set_infrared_share(scene: kuafu.Scene, share: float) -> None:
    """Gives this infrared share to every lamp for which the file states no infrared light."""
    for number in range(scene.summary.light_count):
        light = scene.get_light(number)
        if light.ir_intensity is None and light.ir_share == 0.0:
            light.ir_share, light.ir_intensity = share, None if share else 0.0
            scene.set_light(number, light)


# An office, as EN 12464-1 asks for 300 to 500 lux: light from all sides in a scene without lamps.
ROOM_LUX = 400.0
ROOM_WITHOUT_LAMPS = ROOM_LUX / (np.pi * LUMENS_PER_WATT)  # W/(sr m^2): an even sky of radiance L gives pi L
# Radiance of light from such a room's walls, W/(sr m^2), for a scene with lamps.
ROOM_RADIANCE = 0.1

# kuafu's light groups, which separate a picture's light: lamps, emissive surfaces, light from all sides.
LAMPS, SURFACES, ALL_SIDES = 0, 1, 2


def part_light(scene: kuafu.Scene) -> None:
    """Puts the light of emissive surfaces into the group SURFACES, so that renders can tell it from other lights. The
    caller sets the group of light from all sides."""
    for number in range(scene.summary.material_count):
        material = scene.get_material(number)
        if any(material.emission) or material.ir_emission:
            material.light_group = SURFACES
            scene.set_material(number, material)


def room_radiance(scene: kuafu.Scene) -> float:
    """Returns the default visible radiance from all sides, W/(sr m^2): light from a room's walls if the scene has
    lamps, else the light of an office."""
    return ROOM_RADIANCE if has_lamps(scene) else float(ROOM_WITHOUT_LAMPS)


def has_lamps(scene: kuafu.Scene) -> bool:
    """Returns whether the scene has a light or an emissive surface."""
    summary = scene.summary
    return summary.light_count > 0 or any(
        any(scene.get_material(number).emission) for number in range(summary.material_count)
    )


# In a map's own axes row 0 lies along -y. A scene with y up rotates the map by half a turn about x. Then the middle
# column lies along -z, where a glTF camera looks, and columns go towards +x.
MAP_TO_Y_UP = np.diag([1.0, -1.0, -1.0])


def read_environment_map(path: str | Path) -> np.ndarray:
    """Reads an equirectangular image, twice as wide as high, as linear RGB radiance, float32 [height, width, 3]. Raises
    ValueError."""
    path = Path(path)
    if not path.exists():
        raise ValueError(f"{path}: there is no such file")
    # OpenCV reads OpenEXR only where the environment says so, for files that are not trusted.
    os.environ.setdefault("OPENCV_IO_ENABLE_OPENEXR", "1")
    import cv2

    try:
        pixels = cv2.imread(str(checked_file(path)), cv2.IMREAD_UNCHANGED)
    except (OSError, cv2.error) as error:
        raise ValueError(f"{path}: cannot be read: {str(error).splitlines()[0]}") from error
    if pixels is None:
        raise ValueError(f"{path}: is no image that can be read: .hdr, .exr, .png and .jpg can be")
    # OpenCV's image is grey or BGR or BGRA of any depth.
    height, width = pixels.shape[:2]
    if width != 2 * height:
        raise ValueError(f"{path}: is {width}x{height} pixels, an equirectangular map is twice as wide as high")
    channels = pixels[..., None] if pixels.ndim == 2 else pixels[..., :3][..., ::-1]
    rgb = np.broadcast_to(channels, (height, width, 3))
    if rgb.dtype.kind == "u":
        return srgb.linear(rgb.astype(np.float32) / np.iinfo(rgb.dtype).max)
    out = np.ascontiguousarray(rgb, np.float32)
    if not np.isfinite(out).all() or out.min() < 0:
        raise ValueError(f"{path}: has radiances that are negative or not finite: clamp them in an editor")
    return out


def set_environment_map(scene: kuafu.Scene, path: str | Path, scale: float = 1.0) -> None:
    """Lights a scene with y up by an environment map file, times `scale`, in the light group ALL_SIDES. Raises
    ValueError."""
    texture = scene.add_texture(read_environment_map(path), name=Path(path).name)
    scene.set_environment((scale, scale, scale), texture=texture, map_to_world=MAP_TO_Y_UP, light_group=ALL_SIDES)
