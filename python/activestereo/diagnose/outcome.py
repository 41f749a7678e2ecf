# SPDX-License-Identifier: Apache-2.0
"""Holds the result of a search: its rounds, and the effects that it named."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from scipy.special import chdtrc, chdtri

from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.fields import FieldFit
from activestereo.diagnose.fitter import RIG_AMPLITUDES, Fitter, ImageResidual, Solution
from activestereo.diagnose.noise import NoiseTerm
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.refit import Refit
from activestereo.diagnose.selection import Candidate
from activestereo.diagnose.verdict import Remainder
from activestereo.effects import Effect, Stage
from activestereo.effects.core.descriptor import GEOMETRY_FAMILIES, Lever, SharedBy


@dataclass(frozen=True)
class Round:
    """Holds the results of one round of the search, by effect id: candidates (scores), fields (random fields) and fits.
    chi2, structure: of the residual before the round. members: {effect: probability} of the effects that fit alike.
    gain: fall of chi2 by the best effect; floor, chance: the falls that it must exceed. All three are shares of
    chi2."""

    candidates: dict[str, Candidate]
    fields: dict[str, FieldFit]
    chi2: float
    floor: float
    structure: float
    fits: dict[str, Refit] = field(default_factory=dict)
    members: dict[str, float] = field(default_factory=dict)
    gain: float = 0.0
    chance: float = 0.0


@dataclass(frozen=True)
class Name:
    """An effect that the search named as missing. members: {effect: probability} of all effects that this recording
    cannot distinguish, the named one included. gain: fall of the mean squared residual, in noise variances. missed:
    share of the gain that the effect's formula may have failed to explain. field: fit of its random field, or None.
    seen: the round that named it; None if repeated frames showed it."""

    effect: Effect
    members: dict[str, float]
    gain: float
    missed: float = 0.0
    field: FieldFit | None = None
    seen: Round | None = None

    @property
    def id(self) -> str:
        return self.effect.id

    @property
    def in_model(self) -> bool:
        """Whether the fitted model holds the effect: it is neither a random field nor temporal noise."""
        return self.seen is not None and self.field is None


def takes_any_light(names: Sequence[Name]) -> bool:
    """Returns whether the names include random fields of dots and of views, and an effect of expected images. Together
    such fields absorb any error that an unknown effect leaves in the projector's light."""
    fields = [n for n in names if n.field is not None]
    shared = {t.shared_by for n in fields for t in n.effect.random_terms if t.lever is Lever.PROJECTOR}
    has_image = any(n.in_model for n in names)
    return has_image and {SharedBy.DOT, SharedBy.VIEW} <= shared


def strain(
    names: Sequence[Name], evidence: Evidence, fitter: Fitter, first: Solution, fit: Solution, numbers: Numbers
) -> float:
    """Returns the largest change of a pose, focal length or albedo by the named effects, in stated deviations. Air and
    surface effects change the meaning of an albedo. Beside an effect of geometry the rig's whole correction counts, by
    its probability: together they may imitate an unknown motion of the pattern. If no effect is named, it is the second
    largest deviation of an albedo, since one albedo may be measured wrong. first, fit: without and with the effects."""
    if not names:
        return fitter.albedo_sigmas(fit, evidence.capture.uncertainty.albedo, farthest=2)
    of_rig = 0.0
    if any(n.effect.family in GEOMETRY_FAMILIES for n in names):
        as_unlikely = float(chdtri(RIG_AMPLITUDES, chdtrc(1, numbers.strain**2)))
        of_rig = numbers.strain * fitter.rig_penalty(fit) / as_unlikely
    if any(Stage.MEDIUM <= n.effect.stage <= Stage.SURFACE for n in names):
        return of_rig
    return max(of_rig, fitter.prior_sigmas(fit, first))


@dataclass(frozen=True)
class Outcome:
    """The result of a search. first, solution: fits without and with the named effects, on a random part of the pixels.
    rows: residuals of all train images under `solution`, with predicted random fields subtracted. noise: {effect:
    fitted noise term}. unjudged: {effect: reason}. rest: the numbers behind the verdict."""

    evidence: Evidence
    fitter: Fitter
    first: Solution
    solution: Solution
    rows: tuple[ImageResidual, ...]
    names: tuple[Name, ...]
    noise: dict[str, NoiseTerm]
    unjudged: dict[str, str]
    rest: Remainder
    rounds: tuple[Round, ...]
