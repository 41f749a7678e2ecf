# SPDX-License-Identifier: Apache-2.0
"""Holds the result of a search: its rounds, and the effects that it named."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.fields import FieldFit
from activestereo.diagnose.fitter import Fitter, ImageResidual, Solution
from activestereo.diagnose.noise import NoiseTerm
from activestereo.diagnose.refit import Refit
from activestereo.diagnose.selection import Candidate
from activestereo.diagnose.verdict import Remainder
from activestereo.effects import Effect
from activestereo.effects.core.descriptor import Lever, SharedBy


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


def takes_any_light(names: Sequence[Name]) -> bool:
    """Returns whether the names include random fields of dots and of views, and an effect of expected images. Together
    such fields absorb any error that an unknown effect leaves in the projector's light."""
    fields = [n for n in names if n.field is not None]
    shared = {t.shared_by for n in fields for t in n.effect.random_terms if t.lever is Lever.PROJECTOR}
    has_image = any(n.seen is not None and n.field is None for n in names)
    return has_image and {SharedBy.DOT, SharedBy.VIEW} <= shared


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
