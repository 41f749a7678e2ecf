# SPDX-License-Identifier: Apache-2.0
"""Lamps in the units of scene files, and the infrared light of each kind of lamp.

Scene files state photometric units: candela and lux (KHR_lights_punctual), nits (UsdLux). Divided by LUMENS_PER_WATT
they are visible light in W/sr, W/m^2 and W/(sr m^2). A camera's `ir_ambient_scale` says how much of a white LED's
visible light its infrared imagers count; INFRARED_SHARES says how much more they count of other lamps that are as
bright to the eye.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from activestereo.common.nearest import unknown

if TYPE_CHECKING:
    import kuafu

# Luminous efficacy at 540 THz, which defines the candela (SI brochure, 9th edition, section 2.3.1). Blender's exporter
# multiplies its watts by it.
LUMENS_PER_WATT = 683.0

# Counts of an unfiltered silicon imager per lumen, over those of a white LED of 300 lm/W (Murphy, J. Appl. Phys. 111,
# 2012). What glows follows Planck's law at the temperature given; the imager's quantum efficiency is even to 600 nm and
# falls to 0 at 1050 nm. Fluorescent lamps, like LEDs, send next to nothing beyond 700 nm.
INFRARED_SHARES = {
    "led": 1.0,
    "fluorescent": 1.0,
    "sun": 1.6,  # 5778 K
    "halogen": 2.9,  # 3000 K
    "incandescent": 3.6,  # 2700 K
    "candle": 9.6,  # 1900 K
}


def infrared_share(kind: str) -> float:
    """The share of a kind of lamp, or a number of one's own. ValueError says what is known."""
    try:
        share = INFRARED_SHARES[kind] if kind in INFRARED_SHARES else float(kind)
    except ValueError:
        raise ValueError(unknown("lamp", kind, INFRARED_SHARES) + ", or a number of at least 0") from None
    if not 0.0 <= share < 1e6:
        raise ValueError(f"the infrared share of a lamp is {share:g}, it must be at least 0 and below 1e6")
    return share


def set_infrared_share(scene: kuafu.Scene, share: float) -> None:
    """Makes every lamp whose infrared light the file does not state one of this share."""
    for number in range(scene.summary.light_count):
        light = scene.get_light(number)
        if light.ir_intensity is None and light.ir_share == 0.0:
            light.ir_share, light.ir_intensity = share, None if share else 0.0
            scene.set_light(number, light)
