# SPDX-License-Identifier: Apache-2.0
"""Findings of a diagnosis in frozen records: explanations by effects, their scores, and a ranking of them.

A channel gives Explanations; scores and checks turn them into Findings; verdicts are functions of Findings alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from activestereo.diagnose.refine.fitter import ImageResidual
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.diagnose.score.intervals import Interval
from activestereo.diagnose.score.likelihood import gain_error
from activestereo.diagnose.thresholds import Thresholds
from activestereo.effects import Effect, Model
from activestereo.effects.core.judging import Channel


@dataclass(frozen=True)
class BaseFit:
    """A model with its nuisances fitted and no effect added; every candidate has to improve on it.

    chi2: cross-validated; tile_chi2: as fitted, by tile. white_reduced_chi2: what stays between repeats and is white
    over the image, as a renderer's own noise is.
    """

    model: Model
    solution: Solution
    chi2: float
    tile_chi2: np.ndarray
    train: tuple[ImageResidual, ...]
    test: tuple[ImageResidual, ...]
    white_reduced_chi2: float


@dataclass(frozen=True)
class FieldFit:
    """Fields of random draws, fitted.

    residuals: of the train images after each was predicted from others. sigma, error: {parameter: deviation of a draw,
    its standard error}; share: of the places that have a sparse draw.
    """

    residuals: tuple[np.ndarray, ...]
    sigma: Mapping[str, float]
    error: Mapping[str, float]
    share: float = 0.0


@dataclass(frozen=True)
class OwnEvidence:
    """The evidence of a channel that does not look at expected images.

    nats: gain of log-likelihood. share: of the variance or squared error there that the effect explains. consistency:
    share of the frames that get better. pose_error_nats: what errors of the measured poses may explain of the gain.
    """

    nats: float
    share: float
    consistency: float = 1.0
    pose_error_nats: float = 0.0


@dataclass(frozen=True)
class Explanation:
    """An effect's fitted explanation of the data on its channel.

    chi2, tile_chi2: of the train images with it; the base's where the channel looks at something else. solution: the
    fit of an expected image. fields: of random draws. own: the evidence of other channels. repeats_reduced_chi2: what
    the effect leaves in every frame of a view alike (rounding to coarse steps), which is no other effect's.
    """

    effect: Effect
    channel: Channel
    parameters: Mapping[str, Interval]
    chi2: float
    tile_chi2: np.ndarray
    solution: Solution | None = None
    fields: FieldFit | None = None
    own: OwnEvidence | None = None
    repeats_reduced_chi2: float = 0.0

    @property
    def fitted(self) -> Solution:
        """The solution where there is one: an explanation on expected images has it."""
        assert self.solution is not None, self.effect.id
        return self.solution


@dataclass(frozen=True)
class NotRanked:
    """An effect that could not be ranked, and why: a sentence."""

    effect: Effect
    reason: str


@dataclass(frozen=True)
class Score:
    """The score of an explanation.

    nats: gain of log-likelihood. explained_share: of the error above the floor. gain_reduced_chi2: fall of the mean
    square. consistency: share of the touched images that get better. choice_nats: the part of the gain that choices or
    errors of the scene measurement may explain. occam_nats: the penalty for free parameters, <= 0.
    """

    nats: float
    explained_share: float
    gain_reduced_chi2: float
    consistency: float
    choice_nats: float = 0.0
    occam_nats: float = 0.0


@dataclass(frozen=True)
class Checks:
    """Checks of the explanations that matter.

    plain_share, plain_reduced_chi2: explained_share and gain_reduced_chi2 of the unweighted error in DN;
    plain_share_low: the lower end of the share's 95 % interval.
    varying_reduced_chi2: what a varying amplitude of the effect's signature explains beyond a constant one.
    structure_reduced_chi2: structure that it leaves (score/structure.py). at_range_end: whether a shape parameter was
    driven to an end of its range. prior_sigmas: how far geometry or an albedo is at most from what is stated, in the
    stated deviations; of a finding, beyond where the base takes it.
    None: not checked.
    """

    plain_share: float | None = None
    plain_share_low: float | None = None
    plain_reduced_chi2: float = 0.0
    varying_reduced_chi2: float = 0.0
    structure_reduced_chi2: float | None = None
    at_range_end: bool = False
    prior_sigmas: float = 0.0


@dataclass(frozen=True)
class BaseChecks(Checks):
    """Further checks of the base.

    plain_excess_reduced_chi2: excess of the unweighted mean squared error in DN above the noise. unsteady_reduced_chi2,
    uneven_structure_reduced_chi2: see score/steadiness.py.
    """

    plain_excess_reduced_chi2: float = 0.0
    unsteady_reduced_chi2: float = 0.0
    uneven_structure_reduced_chi2: float = 0.0


@dataclass(frozen=True)
class Remainder:
    """The residual that an explanation, or the base, leaves. chi2: of the train images; is_of_draws: whether it has
    draws that other frames predict in part; the others as in Explanation and Checks."""

    chi2: float
    repeats_reduced_chi2: float
    structure_reduced_chi2: float | None
    prior_sigmas: float = 0.0
    is_of_draws: bool = False


@dataclass(frozen=True)
class Finding:
    """An Explanation with what it is worth."""

    explanation: Explanation
    score: Score
    checks: Checks = Checks()

    @property
    def id(self) -> str:
        return self.explanation.effect.id

    @property
    def effect(self) -> Effect:
        return self.explanation.effect

    @property
    def channel(self) -> Channel:
        return self.explanation.channel

    @property
    def on_images(self) -> bool:
        """Whether it is judged on the infrared images: an expected image or fields of draws that stay."""
        return self.channel in (Channel.EXPECTED_IMAGE, Channel.STATIC_FIELD)

    @property
    def chi2(self) -> float:
        return self.explanation.chi2

    @property
    def solution(self) -> Solution | None:
        return self.explanation.solution

    @property
    def fitted(self) -> Solution:
        return self.explanation.fitted

    @property
    def remainder(self) -> Remainder:
        e, checks = self.explanation, self.checks
        of_draws = self.channel is Channel.STATIC_FIELD
        return Remainder(e.chi2, e.repeats_reduced_chi2, checks.structure_reduced_chi2, checks.prior_sigmas, of_draws)


@dataclass(frozen=True)
class Ranking:
    """Findings on top of a base, those that may be named first, each part by its gain.

    pixels: of the train images. design_effect: by how much the residuals of neighbours vary together. noise_chi2:
    chi2 of the best model, or of the noise alone where that is less: what counts as the floor.
    """

    base: BaseFit
    base_checks: BaseChecks
    findings: tuple[Finding, ...]
    not_ranked: tuple[NotRanked, ...]
    pixels: int
    design_effect: float
    noise_chi2: float
    thresholds: Thresholds

    @property
    def best(self) -> Finding | None:
        return self.findings[0] if self.findings else None

    @property
    def base_remainder(self) -> Remainder:
        checks = self.base_checks
        return Remainder(self.base.chi2, 0.0, checks.structure_reduced_chi2, checks.prior_sigmas)

    @property
    def excess_reduced_chi2(self) -> float:
        """The base's residual above the noise and the renderer's own noise, in noise variances."""
        return self.base.chi2 / self.pixels - 1.0 - self.base.white_reduced_chi2

    @property
    def at_floor(self) -> bool:
        """Whether the expected images lack nothing."""
        return self.excess_reduced_chi2 < self.thresholds.unexplained_reduced_chi2

    def excess_after(self, chi2: float) -> float:
        """The residual of an explanation with this chi2 above the noise, in noise variances."""
        return max(chi2 / self.pixels - self.noise_chi2 / self.pixels, 0.0)

    def difference_error(self, first: Finding, second: Finding) -> float:
        """Standard error of the difference of two findings' nats."""
        tiles = first.explanation.tile_chi2, second.explanation.tile_chi2
        return gain_error(*tiles, min(first.chi2, second.chi2), self.pixels, self.design_effect)
