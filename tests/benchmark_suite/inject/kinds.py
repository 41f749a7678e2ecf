# SPDX-License-Identifier: Apache-2.0
"""Defines the effects that measured images may get, their strengths, and their names in the lab's library."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from inject import effects
from inject.effects import Light

STRENGTHS = ("weak", "medium", "strong")


@dataclass(frozen=True)
class Kind:
    """One kind of effect, with its parameter's values and limits.

    values: one for each of STRENGTHS. low, high: limits of a value. in_dn: values are DN of an image of 8 bits.
    one_camera: the seed picks the left or the right camera. drawn: further parameters, drawn from the seed. accepted:
    right names in the lab's library, empty if it has no such effect. behind_noise: the effect acts on the imager's
    noise, too.
    """

    apply: Callable[..., Light]
    parameter: str
    unit: str
    values: tuple[float, float, float]
    low: float
    high: float
    accepted: tuple[str, ...]
    one_camera: bool = False
    behind_noise: bool = False
    in_dn: bool = False
    drawn: Callable[[np.random.Generator], Mapping[str, float]] = lambda _: {}

    def value(self, strength: str) -> float:
        """Returns the parameter's value for a strength's name or a number as text. ValueError has the choices."""
        if strength in STRENGTHS:
            return self.values[STRENGTHS.index(strength)]
        try:
            value = float(strength)
        except ValueError:
            raise ValueError(f"is {strength!r}, expected {', '.join(STRENGTHS)} or a number") from None
        if not self.low <= value <= self.high or value == 0.0:
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise ValueError(f"is {value:g}, expected {self.low:g} to {self.high:g}{unit} and not 0 ({self.parameter})")
        return value


def _mains(generator: np.random.Generator) -> dict[str, float]:
    """Draws twice a mains frequency, of 50 or 60 Hz, and a phase."""
    frequency = generator.choice([100.0, 120.0]) + generator.uniform(-0.2, 0.2)
    return {"frequency_hz": float(frequency), "phase_rad": float(generator.uniform(-np.pi, np.pi))}


def _direction(generator: np.random.Generator) -> dict[str, float]:
    return {"direction_rad": float(generator.uniform(-np.pi, np.pi))}


KINDS: dict[str, Kind] = {
    "blur": Kind(
        effects.blur, "radius_px", "px", (0.8, 1.4, 2.2), 0.0, 10.0, ("focus_mismatch", "lens_psf"), one_camera=True
    ),
    "veiling_glare": Kind(effects.veiling_glare, "fraction", "1", (0.03, 0.08, 0.2), 0.0, 0.9, ("veiling_glare",)),
    "ghost": Kind(effects.ghost, "fraction", "1", (0.02, 0.05, 0.12), 0.0, 0.9, ("lens_ghost",)),
    "gain": Kind(effects.gain, "excess", "1", (0.03, 0.08, 0.2), -0.9, 4.0, ("gain_mismatch",), True, True),
    "radial_distortion": Kind(
        effects.radial_distortion, "k1", "1", (0.001, 0.003, 0.01), -0.1, 0.1, ("radial_distortion",)
    ),
    "tangential_distortion": Kind(
        effects.tangential_distortion,
        "size",
        "1",
        (0.0005, 0.0015, 0.005),
        -0.03,
        0.03,
        ("tangential_distortion",),
        drawn=_direction,
    ),
    "bands": Kind(effects.bands, "depth", "1", (0.03, 0.08, 0.2), 0.0, 1.0, ("flicker_banding",), drawn=_mains),
    "black_level": Kind(
        effects.black_level,
        "offset_dn",
        "DN",
        (0.5, 1.5, 4.0),
        -50.0,
        50.0,
        ("gain_mismatch", "black_level"),
        one_camera=True,
        behind_noise=True,
        in_dn=True,
    ),
    "row_noise": Kind(
        effects.row_noise, "sigma_dn", "DN", (0.3, 0.8, 2.0), 0.0, 30.0, ("row_noise",), behind_noise=True, in_dn=True
    ),
    "dead_dots": Kind(effects.dead_dots, "share", "1", (0.02, 0.06, 0.15), 0.0, 0.9, ("dot_gain_spread",)),
    "vignetting": Kind(effects.vignetting, "exponent", "1", (0.4, 1.2, 3.0), -8.0, 8.0, ("vignetting",)),
    "response": Kind(
        effects.response, "compression", "1", (0.1, 0.3, 1.0), -0.5, 10.0, ("response_gamma",), behind_noise=True
    ),
}
