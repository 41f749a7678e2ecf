# SPDX-License-Identifier: Apache-2.0
"""Makes the credible set of a name: the effects that a recording cannot tell apart, with probabilities.

Sets that hold the truth with a stated probability follow SuSiE (Wang et al. 2020, JRSS B 82). Because formulas of
effects are not exact, log odds count in units of the formulas' error.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from activestereo.diagnose.fitter import Fitter, Solution
from activestereo.diagnose.goodness import design_effect, occam_nats
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.refit import Refit, formula_error
from activestereo.effects import Effect

# The penalty of a random field's parameters, nats, in place of occam_nats().
_OF_A_FIELD = -3.0
# The power of _calibrated(): it maximises the likelihood of the 31 sets with one true member in the training
# generations 50525 and 81119, where 30 first members were right and 0.71 of them were expected to be.
_SHARPER = 5.0


def members_of(
    left: Mapping[str, float],
    fits: Mapping[str, Refit],
    effects: Sequence[Effect],
    fitter: Fitter,
    without: Solution,
    numbers: Numbers,
) -> dict[str, float]:
    """Returns the credible set {effect: probability of being the missing one}, likeliest first. left: {effect: chi2 of
    its fit}. fits: the fits; random fields have none. without: the fit without these effects. The measured error of a
    formula and the usual error have equal weight."""
    best, pixels = min(left, key=lambda name: left[name]), fitter.pixels_used()
    likeliest = fits[best].solution if best in fits else without
    design = design_effect(likeliest.sums.tile_chi2, fitter.tile_pixels())
    nats = {name: 0.5 * pixels / design * np.log(without.sums.total / chi2) for name, chi2 in left.items()}

    def logs(names: Iterable[str], missed: float) -> dict[str, float]:
        unit, out = max(1.0, missed * nats[best]), {}
        for name in names:
            fit = fits[name].solution if name in fits else None
            occam = _OF_A_FIELD if fit is None else occam_nats(fitter, fit, fit.effects[-1], design * unit)
            out[name] = nats[name] / unit + occam
        return out

    question = credible(logs(nats, numbers.formula_error), 1.0 - numbers.alpha)
    measured = max(formula_error(e, numbers.formula_error) for e in effects if e.id in question)
    sharp = credible(logs(question, min(measured, numbers.formula_error)), 1.0)
    both = {name: float(np.log(p + sharp.get(name, 0.0))) for name, p in question.items()}
    return _calibrated(credible(both, numbers.credible))


def credible(nats: Mapping[str, float], mass: float) -> dict[str, float]:
    """Returns the smallest set {name: probability}, likeliest first, whose probabilities reach `mass`. nats: {name: log
    evidence}."""
    names = sorted(nats, key=lambda name: -nats[name])
    p = np.exp([nats[name] - nats[names[0]] for name in names])
    p /= p.sum()
    count = int(np.searchsorted(np.cumsum(p), mass)) + 1
    return {name: float(x) for name, x in zip(names[:count], p, strict=False)}


def parted(sets: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Returns {named effect: its credible set} without the other named effects, with the same sum. sets: the same with
    them. An effect that is named later may stand in an earlier name's set."""
    out = {}
    for name, members in sets.items():
        kept = {member: p for member, p in members.items() if member == name or member not in sets}
        scale = sum(members.values()) / sum(kept.values()) if len(kept) < len(members) else 1.0
        out[name] = {member: scale * p for member, p in kept.items()}
    return out


def _calibrated(members: Mapping[str, float]) -> dict[str, float]:
    """Returns a set's probabilities, adjusted to how often its members prove right. They are raised to a power and
    scaled to the same sum (temperature scaling; Guo et al. 2017, ICML)."""
    powers = {name: p**_SHARPER for name, p in members.items()}
    scale = sum(members.values()) / sum(powers.values())
    return {name: scale * p for name, p in powers.items()}
