# SPDX-License-Identifier: Apache-2.0
"""Describes how captures show an effect. Each effect's descriptor holds this for the lab, which thus needs no effect's
name.

A deterministic effect up to the digital numbers changes the *expected image* and needs no description. All others have
one:

    STATIC randomness     RandomTerms: random fields that stay, found by predicting one frame from others
    TEMPORAL randomness   RandomTerms: terms of the noise model, found in the differences of repeats
    CodeSteps             digital numbers come in steps, found in their histogram
    EngineFault           how a fault of the depth engine is judged; other effects on disparity and depth need none
    Unjudged              why no capture shows the effect
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from activestereo.effects.core.light import Light
    from activestereo.effects.core.view import View


class Channel(Enum):
    """The data on which an effect is judged: expected images, random fields that stay, repeats of a frame, or the
    device's disparity."""

    EXPECTED_IMAGE = "expected image"
    STATIC_FIELD = "static field"
    NOISE_MODEL = "noise model"
    DEPTH_ENGINE = "depth engine"


class Lever(Enum):
    """The signal that scales a random draw of standard deviation 1, besides the parameter.

    ONE: 1 DN. SIGNAL: DN above black. PROJECTOR: DN of the projector's direct light. EXPOSURE: exposure time x gain,
    seconds. PHOTONS: the square root of gain x DN above black; here the parameter scales the variance.
    """

    ONE = "one"
    SIGNAL = "signal"
    PROJECTOR = "projector"
    EXPOSURE = "exposure"
    PHOTONS = "photons"


class SharedBy(Enum):
    """The pixels and images that share one random draw.

    PIXEL: a pixel of one camera, in all frames (in one frame, where the effect is TEMPORAL). VIEW: a pixel of one
    camera while the rig stands still. COLUMN, ROW: all pixels of a column or row of one camera. DOT: all pixels that
    see one dot of the pattern.
    """

    PIXEL = "pixel"
    VIEW = "view"
    COLUMN = "column"
    ROW = "row"
    DOT = "dot"


@dataclass(frozen=True)
class RandomTerm:
    """Declares one random field or one term of the noise model. Its size is parameter x lever (a signal, see Lever) x a
    draw of standard deviation 1.

    parameter: the name of the parameter that scales it. sparse_share: the name of the parameter that gives the share of
    pixels with a draw; "" = all pixels have one.
    """

    parameter: str
    lever: Lever
    shared_by: SharedBy = SharedBy.PIXEL
    sparse_share: str = ""


@dataclass(frozen=True)
class CodeSteps:
    """States that an effect rounds digital numbers to multiples of a step. parameter: the effect's parameter that holds
    the step in DN."""

    parameter: str


@dataclass(frozen=True)
class EngineFault:
    """Declares how a fault of the depth engine is judged.

    is_matcher_choice: the fault depends on the choice of the matcher (a sub-pixel formula, a rounding, the size of a
    median). It is fitted and reported, but never called a fault of the sensor. displaces: its parameters shift the
    picture by pixels, as errors of the measured poses do.
    """

    is_matcher_choice: bool = False
    displaces: bool = False


@dataclass(frozen=True)
class Unjudged:
    """Declares that the lab never ranks the effect, although it is simulated. reason: why a capture does not show
    it."""

    reason: str


Judgement = RandomTerm | CodeSteps | EngineFault | Unjudged


@dataclass(frozen=True)
class StartImage:
    """A measured image, compared with its prediction by the model without the effect. The effect proposes starting
    values of its fit from it. Arrays are [height][width].

    weight: inverse variance, 1/DN^2. residual: measured minus expected, DN. ambient: DN of ambient light in the
    expected image, 0 where it is clipped. ambient_dn: DN per unit of ambient radiance. expected: DN above black.
    """

    view: View
    light: Light
    weight: np.ndarray
    residual: np.ndarray
    ambient: np.ndarray
    ambient_dn: float
    expected: np.ndarray


# A function that proposes starting values of a fit: the best few {parameter: value}, best first.
Starts = Callable[[list[StartImage]], list[dict[str, float]]]
