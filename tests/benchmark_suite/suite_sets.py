# SPDX-License-Identifier: Apache-2.0
"""The benchmark sets: case k hides the same in every run; generation 0 is reported, others are to learn from."""

import hashlib
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("support", "bench")]

from virtual_sensor.held_out import catalogue  # noqa: E402
from virtual_sensor.held_out.mitsuba_case import NOT_RENDERED  # noqa: E402
from virtual_sensor.held_out.catalogue import DEPTH_ENGINE, FILTERS, OUTSIDE, SINGLE, STRENGTHS, WIDER  # noqa: E402

MEDIUM, STRONG = STRENGTHS.index("medium"), STRENGTHS.index("strong")
PAIRS, NONES, DEPTH_ONLY = 40, 100, 4
MITSUBA_SINGLE, MITSUBA_OUTSIDE, MITSUBA_NONE = 18, 4, 6
_CODES = {"single": 1, "pairs": 2, "outside": 3, "none": 4, "depth": 5, "wider": 6, "filters": 7, "mitsuba": 8}
ALL = ("single", "pairs", "outside", "none", "depth", "wider")
_SMALL = (
    ("none", 0), ("none", 1), ("single", "projector_defocus"), ("single", "radial_distortion"),
    ("single", "response_gamma"), ("pairs", ("rolling_shutter", "exposure_desync")),
    ("single", "vignetting"), ("single", "prnu"), ("single", "laser_power_drift"),
    ("single", "stereo_pitch"), ("pairs", ("lens_psf", "projector_defocus")), ("outside", "column_crosstalk"),
)  # fmt: skip


@dataclass(frozen=True)
class Item:
    """One test case. strengths: ((effect, index into STRENGTHS), ...). infrared: False leaves the images out."""

    set: str
    number: int
    strengths: tuple
    infrared: bool = True
    generation: int = 0

    @property
    def id(self):
        plain = f"{self.set}-{self.number:03}"
        return f"g{self.generation}-{plain}" if self.generation else plain

    @property
    def seed(self):
        return 10_000_000 * self.generation + 100_000 * _CODES[self.set] + self.number

    @property
    def anonymous_name(self):
        """The capture's name, from which the tool under test learns nothing."""
        return "case-" + hashlib.sha256(f"bank {self.seed}".encode()).hexdigest()[:10]

    def draw(self):
        """Draws the case's (hidden effects {id: parameters}, moving frames' exposure) from its seed."""
        return catalogue.draw_hidden(dict(self.strengths), np.random.Generator(np.random.PCG64([self.seed, 9])))


def items(name, generation=0):
    """Returns the Items of a set. 'all' mixes all sets of ALL, so that any part of it is a fair sample."""
    return [replace(item, generation=generation) for item in _items(name)]


def _items(name):
    if name == "small":
        return [_small(*entry) for entry in _SMALL]
    if name == "all":
        found = [item for part in ALL for item in _items(part)]
        return [found[i] for i in np.random.Generator(np.random.PCG64(1)).permutation(len(found))]
    cases = {
        "single": _each(SINGLE, range(len(STRENGTHS))), "pairs": _pairs(), "outside": _each(OUTSIDE), "depth": _depth(),
        "none": [({}, True)] * NONES, "wider": _each(WIDER), "filters": _each(FILTERS), "mitsuba": _mitsuba(),
    }[name]  # fmt: skip
    return [
        Item(name, number, tuple(strengths.items()), infrared) for number, (strengths, infrared) in enumerate(cases)
    ]


def _each(effects, strengths=(MEDIUM, STRONG)):
    return [({effect: strength}, True) for strength in strengths for effect in effects]


def _pairs():
    return [(dict.fromkeys(pair, STRONG if i % 2 else MEDIUM), True) for i, pair in enumerate(catalogue.pairs(PAIRS))]


def _mitsuba():
    """Returns cases that Mitsuba renders: effects of the library and others that it can show, and none."""
    rng = np.random.Generator(np.random.PCG64(8))
    kinds = [rng.permutation([name for name in part if name not in NOT_RENDERED]) for part in (SINGLE, OUTSIDE)]
    hidden = [*kinds[0][:MITSUBA_SINGLE], *kinds[1][:MITSUBA_OUTSIDE]]
    cases = [({str(name): STRONG if i % 2 else MEDIUM}, True) for i, name in enumerate(hidden)]
    return cases + [({}, True)] * MITSUBA_NONE


def _depth():
    """Returns cases with depth engine faults beside good images, and cases whose captures hold depth alone."""
    return _each(DEPTH_ENGINE) + [({effect: STRONG}, False) for effect in list(SINGLE)[:DEPTH_ONLY]]


def _small(name, what):
    found = _items(name)
    if name == "none":
        return found[what]
    wanted = {what} if isinstance(what, str) else set(what)
    matching = [item for item in found if set(dict(item.strengths)) == wanted]
    return matching[-1]
