# SPDX-License-Identifier: Apache-2.0
"""How an effect is judged from captures: what its descriptor says to the lab, so that the lab needs no effect's
name.

A deterministic effect up to the digital numbers changes the *expected image*, which needs no further word. All others
say more:

    STATIC randomness     RandomTerms: fields of draws that stay, found by predicting one frame from others
    TEMPORAL randomness   RandomTerms: terms of the noise model, found in the differences of repeats
    CodeSteps             digital numbers come in steps, found in their histogram
    EngineFault           what a fault of the depth engine resembles; other effects on disparity and depth need no word
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
    """The data that an effect is judged on: expected images, fields of draws that stay, repeats, or the device's
    disparity."""

    EXPECTED_IMAGE = "expected image"
    STATIC_FIELD = "static field"
    NOISE_MODEL = "noise model"
    DEPTH_ENGINE = "depth engine"


class Lever(Enum):
    """The factor of a random draw of deviation 1, besides the parameter.

    ONE: 1 DN. SIGNAL: DN above black. PROJECTOR: DN of the projector's direct light. EXPOSURE: exposure x gain,
    seconds. PHOTONS: the square root of gain x DN above black, where the parameter is the variance's factor and not
    the deviation's.
    """

    ONE = "one"
    SIGNAL = "signal"
    PROJECTOR = "projector"
    EXPOSURE = "exposure"
    PHOTONS = "photons"


class SharedBy(Enum):
    """The pixels and images that share one draw.

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
    """One random field or one term of the noise model: parameter x lever x a draw of deviation 1.

    parameter: the name of the parameter that scales it. sparse_share: the name of the parameter that says which share
    of the places has a draw at all; "" = all of them.
    """

    parameter: str
    lever: Lever
    shared_by: SharedBy = SharedBy.PIXEL
    sparse_share: str = ""


@dataclass(frozen=True)
class CodeSteps:
    """Digital numbers come in multiples of a step. parameter: the name of the parameter that is the step in DN."""

    parameter: str


@dataclass(frozen=True)
class EngineFault:
    """The disturbance that a fault of the depth engine resembles.

    is_matcher_choice: it depends on the choice of the matcher (a sub-pixel formula, a rounding, the size of a median):
    it is fitted and reported, and never a fault of the sensor. displaces: it moves what is measured in the picture by
    parameters in pixels, as errors of the measured poses do.
    """

    is_matcher_choice: bool = False
    displaces: bool = False


@dataclass(frozen=True)
class Unjudged:
    """The effect is simulated, and never ranked. reason: why a capture does not show it."""

    reason: str


Judgement = RandomTerm | CodeSteps | EngineFault | Unjudged


@dataclass(frozen=True)
class StartImage:
    """The image under the model without the effect, at which the effect's own proposal of starting values looks,
    [height][width].

    view: a View. light: its Light. weight: 1/DN^2. residual: measured - expected, DN. ambient: DN of ambient light in
    the expected image, 0 where it is clipped. ambient_dn: DN per unit of ambient radiance. expected: DN above black.
    """

    view: View
    light: Light
    weight: np.ndarray
    residual: np.ndarray
    ambient: np.ndarray
    ambient_dn: float
    expected: np.ndarray


# Proposes where fits begin: the best few {parameter: value}, best first.
Starts = Callable[[list[StartImage]], list[dict[str, float]]]
