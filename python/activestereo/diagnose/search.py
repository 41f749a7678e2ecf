# SPDX-License-Identifier: Apache-2.0
"""The search: score all effects, fit the likeliest few, name the best one as missing, and repeat until none passes.

One dictionary of image changes serves all rounds. After an effect is named, the pixels' weights are estimated again,
because the missing effect had passed for noise and misplaced edges. The rig's geometry is estimated again too.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from activestereo.capture.capture import SIDES, ImageKey
from activestereo.diagnose.credible_set import members_of, parted
from activestereo.diagnose.dictionary import Atom, Dictionary, atoms_of, carried, columns_of, first_dictionary, numbered
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.fields import FieldFit, fields_of, has_extended_draws, imitates, is_sparse
from activestereo.diagnose.fitter import RIG_AMPLITUDES, Fitter, ImageResidual, ParameterSpace, Solution
from activestereo.diagnose.gather import weighed_again
from activestereo.diagnose.geometry_search import GivenUp
from activestereo.diagnose.goodness import chance_chi2, local_structure, mean_square
from activestereo.diagnose.linear import Linear, fitted_model, linearised, scored, scores, some_pixels
from activestereo.diagnose.noise import NoiseTerm, comb_in, noise_terms
from activestereo.diagnose.outcome import Name, Outcome, Round, strain, takes_any_light
from activestereo.diagnose.pixels import SCALES
from activestereo.diagnose.refit import (
    SETTLING,
    Refit,
    formula_error,
    missed_share,
    refit_at_peaks,
    refit_free_curve,
    refits,
    restore_functions,
)
from activestereo.diagnose.selection import (
    Candidate,
    candidates,
    freed,
    gain_beyond,
    most_like_rig,
    other_law,
    own_ranks,
    stand_ins,
)
from activestereo.diagnose.settings import Settings
from activestereo.diagnose.verdict import Remainder
from activestereo.effects import Effect, Model, Stage
from activestereo.effects.core.descriptor import Channel

# At most _FITTED effects are fitted, if they score more than _NEAR times the best score. If no fit gains _VAIN times
# its score, the next ones that score the needed gain are fitted. A fit gains at most _LINE_SHORT times its score. If
# that exceeds _CLEAR times the needed gain, random fields need no check; fields below _MINOR of it do not count.
_FITTED, _NEAR, _VAIN, _LINE_SHORT, _CLEAR, _MINOR = 4, 0.25, 0.1, 2.0, 10.0, 0.1
# Effects whose trial points take long are tried if the best fit leaves more than this share of chi2 beyond noise.
_LEFT = 0.1
# The dictionary has all shapes of the effects whose first shapes gain more than this share of the best gain.
_LEADS = 0.1
# Rivals with this part of a name's gain may take its place.
_NEAR_SWAP = 0.6
# Albedos may be off by this part of their stated deviations where a named effect changes their meaning.
_AS_STATED = 0.01
# A noise term is named only if it is this share of the noise. Least part of Numbers.least_excess: without structure.
_NOISE_SHARE, _QUIET = 0.1, 0.5


class Search:
    """Searches for the effects that a given model lacks."""

    def __init__(
        self, evidence: Evidence, given: Model, effects: Sequence[Effect], settings: Settings | None = None
    ) -> None:
        settings, known = settings or Settings(), {e.id for e, _ in given.effects}
        self._given, self._effects = given, [e for e in effects if e.id not in known]
        self._settings, self._numbers, self._rendering = settings, settings.numbers, settings.rendering
        self._names: list[Name] = []
        self._drawn: dict[ImageKey, np.ndarray] = {}
        self._draws: dict[str, dict[ImageKey, np.ndarray]] = {}
        self._needless: set[str] = set()
        self._rounds: list[Round] = []
        self._measured = evidence
        self._use_evidence(evidence)
        self._first = self._solution = fitted_model(self._fitter, given, self._fitter.phi0(evidence.nuisances))
        self._rows = self._whole.residuals(self._solution)
        self._noise, self._unjudged = self._name_noise()
        has_steps = any(n.effect.rounds for n in self._names)
        self._comb = comb_in(evidence) if has_steps else None
        self._rounded: dict[ImageKey, NDArray[np.float64]] = {}
        self._less_rounding()
        self._structure = self._structure_before = local_structure(self._rows)

    def run(self) -> Outcome:
        """Names missing effects, the best one first, until no further one passes the tests. Returns the Outcome."""
        dictionary = self._moved(self._dictionary())
        while self._name_one(dictionary) or self._name_in_place_of_rig(dictionary):
            self._drop_needless()
            dictionary = self._moved(dictionary)
            self._widen_last_set(dictionary)
            self._structure = local_structure(self._rows)
        self._widen_set_of_inexact()
        sets = parted({n.id: n.members for n in self._names})
        self._names = [replace(n, members=sets[n.id]) for n in self._names]
        explained = (self._first.sums.total - self._solution.sums.total) / self._pixels
        drawn = sum(n.gain for n in self._names if n.field is not None)
        left = self._excess - sum(n.field.unforeseen for n in self._names if n.field is not None)
        strained = strain(self._names, self._evidence, self._fitter, self._first, self._solution, self._numbers)
        parts = explained + drawn, left, self._structure, self._structure_before, strained, drawn
        in_images = sum(n.in_model for n in self._names)
        missed = {n.id: max(self._floor() / self._pixels, n.missed * n.gain) for n in self._names}
        is_full = self._is_full() or takes_any_light(self._names)
        rest = Remainder(*parts, names=in_images, is_full=is_full, by_frame=other_law(dictionary.linear, missed))
        return Outcome(
            self._evidence, self._fitter, self._first, self._solution, tuple(self._rows), tuple(self._names),
            self._noise, self._unjudged, rest, tuple(self._rounds),
        )  # fmt: skip

    def _dictionary(self) -> Dictionary:
        """Returns the dictionary of the effects that change the expected images, but for those that start late."""
        reach, memory = self._numbers.prior_reach, self._settings.memory
        first = first_dictionary(self._measured, self._given, self._effects, reach, memory)
        found = candidates(first.atoms, scores(first.linear, first.columns), self._pixels)
        least = _LEADS * max((c.gain for c in found.values()), default=0.0)
        return first.grown({name for name, c in found.items() if c.gain > least})

    def _moved(self, dictionary: Dictionary) -> Dictionary:
        """Returns the dictionary at the present fit."""
        columns = carried(dictionary.columns, dictionary.linear.fitter, self._scored)
        return replace(dictionary, linear=linearised(self._scored, self._solution), columns=columns)

    @property
    def _chi2(self) -> float:
        return self._solution.sums.total

    @property
    def _excess(self) -> float:
        return self._chi2 / self._pixels - 1.0

    def _name_noise(self) -> tuple[dict[str, NoiseTerm], dict[str, str]]:
        """Fits the effects of temporal noise to repeated frames, and names the significant ones. Returns ({effect:
        fitted noise term}, {effect: why it was not judged})."""
        effects = [e for e in self._effects if e.channel is Channel.NOISE_MODEL]
        terms, unjudged = noise_terms(self._measured, self._given, effects, self._numbers)
        for term in terms.values():
            if term.nats > np.log(len(self._effects) / self._numbers.alpha) and term.share > _NOISE_SHARE:
                self._names.append(Name(term.effect, {term.effect.id: 1.0}, 0.0))
        return terms, unjudged

    def _use_evidence(self, evidence: Evidence) -> None:
        """Replaces the evidence and makes new fitters: _whole of all train pixels, _fitter of a random part of them,
        and _scored of that part in one image of each situation. _scored serves scores and first steps of fits."""
        self._evidence, sized = evidence, (evidence.nuisance_prior(), evidence.tiles)
        self._whole = Fitter(evidence.train, *sized)
        self._fitter = Fitter(some_pixels(evidence.train, evidence.seed), *sized, memory=self._settings.memory)
        self._pixels = self._fitter.pixels_used()
        self._scored = Fitter(scored(self._fitter.observations), *sized, memory=self._settings.memory)

    def _name_one(self, dictionary: Dictionary) -> bool:
        """Runs one round: names the likeliest missing effect if its gain is large enough. Returns whether it did.
        dictionary: at the present fit."""
        formulas = [n.effect for n in self._names if n.in_model]
        linear = freed(dictionary.linear, formulas, self._numbers.formula_error)
        tried, others = ([a for a in some if self._is_open(a.effect)] for some in (dictionary.atoms, dictionary.others))
        found = candidates(tried, scores(linear, dictionary.columns), self._pixels)
        lost = self._lost({e.family for e in formulas})
        self._rounds.append(now := self._tried(linear, found, lost, [*tried, *others]))
        left = {} if self._is_full() else self._left(linear, now)
        if not left:
            return False
        rivals = self._rivals(left, now.fields)
        members = members_of(rivals, now.fits, self._effects, self._fitter, self._solution, self._numbers)
        name = next(iter(members))
        gain, effect, refit = self._chi2 - left[name], self._effect(name), now.fits.get(name)
        fit = self._solution if refit is None else refit.solution
        by_chance = self._numbers.alpha / max(len(tried) + len(others), 1)  # of all shapes
        chance = chance_chi2(self._fitter, fit, left[name], len(effect.parameters), by_chance)
        now = self._rounds[-1] = replace(now, members=members, gain=gain / self._chi2, chance=chance / self._chi2)
        if gain < max(self._floor(), chance):
            return False
        missed = missed_share(effect, refit is None or refit.rendered, self._numbers.formula_error)
        field = now.fields[name] if refit is None else None
        self._names.append(named := Name(effect, members, gain / self._pixels, missed, field, now))
        if field is not None:
            self._take_draws(named, self._rows, field)
        else:
            self._accept_last(now.fits)
            self._draw_again()
        return True

    def _tried(
        self, linear: Linear, found: dict[str, Candidate], lost: Mapping[str, Candidate], atoms: Sequence[Atom]
    ) -> Round:
        """Fits the likeliest effects and random fields beside the present model, and returns them as a Round. found:
        the candidates by their scores. lost: others to fit. atoms: trial shapes of all effects that may be named."""
        floor, is_rough = self._floor(), self._structure > self._numbers.structure_kept
        proposing = [e for e in self._effects if e.starts is not None and self._is_open(e)]
        late = [e for e in proposing if e.starts_late and e.id not in lost]
        if self._names:
            again = {*lost, *(c.id for c in found.values() if _LINE_SHORT * c.gain > floor)}
            found = self._found_again(linear, atoms, again, [e for e in proposing if is_rough and e not in late])
        elif found:
            for text in own_ranks(found, self._chi2):
                self._settings.says(text)
        by_line = _LINE_SHORT * max((c.gain for c in found.values()), default=0.0)
        fields = self._fields(by_line)
        by_draws = self._chi2 * max((fit.explained for fit in fields.values()), default=0.0)
        is_over = self._is_full() or (max(by_line, by_draws) < floor and not (is_rough and lost))
        fits = {} if is_over else self._fits(found, lost)
        best_chi2 = min((fit.chi2 for fit in fits.values()), default=self._chi2)
        leaves_much = best_chi2 - self._pixels > _LEFT * (self._chi2 - self._pixels)
        if leaves_much and (is_rough or not self._names) and not self._is_full():
            if more := self._found_again(linear, [], set(), late):
                found = dict(sorted((found | more).items(), key=lambda item: -item[1].evidence))
                fits = self._fits(found, lost)
        return Round(found, fields, self._chi2, floor / self._chi2, self._structure, fits)

    def _fields(self, by_line: float) -> dict[str, FieldFit]:
        """Fits random fields to the residual; returns those that explain enough, {effect: FieldFit}. by_line: the fall
        of chi2 that a fit of another effect may reach."""
        floor, drawn = self._floor(), sum(n.gain for n in self._names if n.field is not None)
        if by_line >= _CLEAR * floor and not self._names:
            return {}
        unnamed, black_dn = filter(self._is_open, self._effects), self._solution.nuisances.black_dn
        fields = fields_of(unnamed, self._rows, black_dn, self._numbers, _MINOR * floor / self._chi2)
        # Beside other fields a field has to gain more: predictions of their draws hold the noise of all images, which
        # images of one camera share. Outliers stand above it.
        least = drawn * len(SIDES) / len(self._evidence.train) * self._pixels / self._chi2
        return {n: fit for n, fit in fields.items() if fit.explained > least or is_sparse(self._effect(n))}

    def _left(self, linear: Linear, now: Round) -> dict[str, float]:
        """Returns {effect: chi2} of a round's fits and fields that explain more than named effects' formulas missed."""
        left = {name: fit.chi2 for name, fit in now.fits.items() if self._is_another(linear, fit)}
        for name, field in now.fields.items():
            # Draws leave no structure, unless neighbouring pixels share them.
            may_be = self._structure < self._numbers.structure or has_extended_draws(self._effect(name))
            if may_be and self._chi2 * field.explained > self._missed([n.missed for n in self._names]):
                left[name] = self._chi2 * (1.0 - field.explained)
        return left

    def _rivals(self, left: Mapping[str, float], fields: Mapping[str, FieldFit]) -> dict[str, float]:
        """Returns the part of `left` among which probabilities decide: effects with much of the best gain, so that few
        parameters do not outweigh a far better fit. Fields that the best field imitates come before it."""
        best = min(left, key=lambda name: left[name])
        gain = self._chi2 - left[best]
        if best in fields:
            least = max(self._floor(), self._numbers.formula_error * gain)
            first = {n: left[n] for n in left if n in fields and imitates(self._effect(best), self._effect(n))}
            return {n: chi2 for n, chi2 in first.items() if self._chi2 - chi2 > least} or dict(left)
        return {n: chi2 for n, chi2 in left.items() if self._chi2 - chi2 > _NEAR_SWAP * gain}

    def _lost(self, families: set[str]) -> dict[str, Candidate]:
        """Returns the candidates to fit beside the last name, {effect: Candidate}: those of its family that were fitted
        with it, or that left structure asks for, and all that fitted nearly as well. Scores are linear: two that move
        the same frames far, such as shutters, score little beside each other."""
        found, is_rough = dict[str, Candidate](), self._structure > self._numbers.structure_kept
        for r in self._rounds[-1:]:
            close = {name for name, fit in r.fits.items() if 1.0 - fit.chi2 / r.chi2 > _NEAR_SWAP * r.gain > 0.0}
            for name, c in r.candidates.items():
                effect = self._effect(name)
                may_be = name in r.fits or (is_rough and c.gain > r.floor * r.chi2)
                if self._is_open(effect) and (name in close or (effect.family in families and may_be)):
                    found[name] = c
        return found

    def _found_again(
        self, linear: Linear, atoms: Sequence[Atom], likely: set[str], proposing: Sequence[Effect]
    ) -> dict[str, Candidate]:
        """Scores likely effects by image changes at the present poses. Earlier ones take pose errors for light.
        proposing: effects that propose trial points from the present residual, likely or not."""
        kept = [a for a in atoms if a.effect.id in likely.difference(e.id for e in proposing)]
        some = numbered([*kept, *atoms_of(linear, proposing, self._numbers.prior_reach)])
        return candidates(some, scores(linear, columns_of(linear, some)), self._pixels) if some else {}

    def _fits(self, found: Mapping[str, Candidate], lost: Mapping[str, Candidate]) -> dict[str, Refit]:
        """Fits the best candidates and those of `lost`, each beside the present model; returns {effect: Refit}."""
        floor, most = self._floor(), max((c.gain for c in found.values()), default=0.0)
        how = {"rendering": self._rendering, "least": floor / _LINE_SHORT}
        fitted = partial(refits, self._fitter, self._scored, self._solution, **how)
        promising = [c for c in found.values() if _LINE_SHORT * c.gain > floor]
        likely = [c for c in promising if c.gain > _NEAR * most][:_FITTED]
        likely += [c for n, earlier in lost.items() if (c := found.get(n, earlier)) not in likely]
        fits = fitted(likely)
        if all(self._chi2 - fits[c.id].chi2 < _VAIN * c.gain for c in likely):
            fits |= fitted([c for c in promising if c not in likely and c.gain > floor][:_FITTED])
        return fits

    def _take_draws(self, name: Name, rows: Sequence[ImageResidual], field: FieldFit | None) -> None:
        """Subtracts the predicted draws of a named random field from the measured images, in place of its earlier
        draws. rows: the residuals that the field was fitted to. field: the fit; None if it found no draws."""
        rest = [row.residual for row in rows] if field is None else field.residuals
        drawn = {row.observation.key: row.residual - left for row, left in zip(rows, rest, strict=True)}
        before, self._draws[name.id] = self._draws.get(name.id, {}), drawn
        self._take_off({key: image - before.get(key, 0.0) for key, image in drawn.items()})
        self._fit_again(self._solution)

    def _draw_again(self) -> None:
        """Estimates the draws of named random fields again after an effect is named, which had distorted them. A field
        that no longer has draws loses its name."""
        for name in [n for n in self._names if n.field is not None]:
            drawn, at = self._draws[name.id], self._names.index(name)
            rows = [row._replace(residual=row.residual + drawn[row.observation.key]) for row in self._rows]
            field = fields_of([name.effect], rows, self._solution.nuisances.black_dn, self._numbers).get(name.id)
            self._take_draws(name, rows, field)
            if field is None:
                del self._names[at]
                self._needless.add(name.id)
            else:
                gain = field.explained / (1.0 - field.explained) * self._chi2 / self._pixels
                self._names[at] = replace(name, field=field, gain=gain)

    def _widen_last_set(self, dictionary: Dictionary) -> None:
        """Adds effects that can imitate a part of the last named effect's image change to its set (stand_ins())."""
        name = self._names[-1] if self._names else None
        if name is None or not name.in_model:
            return
        linear, columns = dictionary.linear, dictionary.columns
        kin = [a for a in dictionary.atoms if a.effect.family == name.effect.family and a.effect.id not in name.members]
        others = [a for a in kin if self._is_open(a.effect)]
        rows = np.concatenate([columns[:0], *(columns[atom.columns()] for atom in others)])
        floor = self._floor() / self._pixels
        self._widen_set(name, stand_ins(linear, name.effect, numbered(others), rows, floor, self._numbers))

    def _widen_set_of_inexact(self) -> None:
        """Widens the set of the named effect whose formula error may explain the most chi2. It adds effects that gained
        enough in the last round to be named, but no more than this error."""
        inexact = max((n for n in self._names if n.in_model), key=lambda n: n.gain * n.missed, default=None)
        fits = self._rounds[-1].fits
        least = self._chi2 - self._floor()
        left = {id: fit.chi2 for id, fit in fits.items() if fit.chi2 < least and self._is_open(self._effect(id))}
        if inexact is not None and left:
            members = members_of(left, fits, self._effects, self._fitter, self._solution, self._numbers)
            self._widen_set(inexact, [id for id in members if id not in inexact.members])

    def _widen_set(self, name: Name, more: Sequence[str]) -> None:
        """Adds effects to a name's set; together they get the probability 1 - Numbers.credible."""
        if more:
            added = dict.fromkeys(more, (1.0 - self._numbers.credible) / len(more))
            kept = {member: p * self._numbers.credible for member, p in name.members.items()}
            self._names[self._names.index(name)] = replace(name, members=kept | added)

    def _floor(self, has_share: bool = True) -> float:
        """Returns the least fall of chi2 to name an effect: a share of chi2 beyond noise, but at least a minimum. The
        minimum halves where the residual has little structure, since errors of the measured scene leave structure."""
        numbers, share = self._numbers, self._numbers.least_share * abs(self._excess) if has_share else 0.0
        quiet = float(np.clip(self._structure / numbers.structure_kept, _QUIET, 1.0))
        return self._pixels * max(numbers.least_excess * quiet, share)

    def _is_another(self, linear: Linear, fit: Refit) -> bool:
        """Returns whether a fit explains more than errors of the named effects' formulas can. Either its gain exceeds
        these errors, or the part of its gain that the named effects cannot imitate exceeds them. The second test is
        only for an effect of another family: the error of a distortion's formula is itself a distortion."""
        if self._chi2 - fit.chi2 > self._missed([n.missed for n in self._names]):
            return True
        if fit.solution.effects[-1].family in {n.effect.family for n in self._names}:
            return False
        usual = self._numbers.formula_error
        own = [usual if n.field else min(usual, formula_error(n.effect, usual)) for n in self._names]
        beyond = gain_beyond(linear, fit.solution) * self._pixels / len(linear.residual)
        return beyond > max(self._floor(), self._missed(own))

    def _missed(self, shares: Sequence[float]) -> float:
        """Returns the fall of chi2 that named effects' formulas may have missed. shares: of each one's gain."""
        return self._pixels * sum(n.gain * share for n, share in zip(self._names, shares, strict=True))

    def _effect(self, name: str) -> Effect:
        return next(e for e in self._effects if e.id == name)

    def _is_open(self, effect: Effect) -> bool:
        """Returns whether an effect may still be named. A dropped effect may not, so that the search ends."""
        return effect.id not in self._needless | {n.id for n in self._names}

    def _accept(self, fit: Solution, at_most: float = np.inf) -> bool:
        """Continues the search from a fit that contains one more named effect. Estimates the poses and the weights
        again under it, and refits. Returns whether the poses changed. Raises GivenUp as Settings.located() does."""
        evidence = before = self._evidence
        if self._settings.located is not None and not evidence.geometry.is_as_stated():
            under = restore_functions(fit.model, self._effects)
            there, self._rendering = self._settings.located(under, evidence, at_most)
            if there is not evidence:  # its images still hold the draws taken off before
                evidence = there.less(self._drawn)
                self._use_evidence(evidence)
                phi0 = self._fitter.phi0(evidence.nuisances)  # a material may be seen enough now to have an albedo
                both = self._first, fit
                self._first, fit = (replace(f, phi=np.append(f.phi[:SCALES], phi0[SCALES:])) for f in both)
                fit = self._fitter.refine(fit.space, fit.theta, fit.phi, *SETTLING)
        self._use_evidence(evidence)
        self._use_evidence(weighed_again(evidence, fit.model, fit.nuisances.black_dn, self._whole.residuals(fit)))
        self._fit_again(refit_at_peaks(self._fitter, fit))
        self._less_rounding()
        return evidence is not before

    def _less_rounding(self) -> None:
        """Subtracts the mean rounding error of coarse digital steps, predicted by the current fit, from the measured
        images. Frames of one view share this error, so it would look like an effect of light."""
        if self._comb is None:
            return
        noise, of_pixels = self._evidence.noise_model, self._evidence.capture.binning**2
        variances = ((o.key, x, of_pixels * noise.variance(x, o.frame.gain)) for o, x, *_ in self._rows)
        rounded = {key: self._comb.mean_error(x, variance) for key, x, variance in variances}
        more = {key: image - self._rounded.get(key, 0.0) for key, image in rounded.items()}
        self._rounded = rounded
        self._take_off(more)
        self._fit_again(self._solution)

    def _accept_last(self, fits: Mapping[str, Refit]) -> None:
        """Accepts the fit of the effect named last. If the poses move, its closest rival is accepted from the same
        start, too. The one that leaves less error gets the name: poses found without an effect absorb a part of its
        image change. The other one joins the set if it leaves about as much. Both are judged by the named effect's
        weights, because a wrong effect lowers its own weights. The rival is given up if it leaves more at once."""
        before, name = dict(vars(self)), self._names[-1]
        if not self._accept(fits[name.id].solution):
            return
        accepted, least = dict(vars(self)), self._floor() / self._pixels
        weights = [o.weight for o in self._evidence.train]
        alone = mean_square(self._rows, weights)
        rival = min((id for id in fits if id != name.id), key=lambda id: fits[id].chi2, default=name.id)
        gain = (fits[name.id].chi2 - fits[rival].chi2) / self._pixels + name.gain
        if gain > _NEAR_SWAP * name.gain and rival != name.id:
            vars(self).update(before)
            with suppress(GivenUp):
                self._accept(fits[rival].solution, accepted["_evidence"].geometry.left + least)
            better = alone - mean_square(self._rows, weights)
            if better > 0.0:
                self._names[-1] = replace(name, effect=self._effect(rival), members={rival: 1.0}, gain=gain + better)
            else:
                vars(self).update(accepted)
            other, name = name.id if better > 0.0 else rival, self._names[-1]
            if abs(better) < least and other not in name.members:
                self._widen_set(name, [other])

    def _name_in_place_of_rig(self, dictionary: Dictionary) -> bool:
        """Names the effect that is most like the rig's correction, and returns whether it did. It is named if the
        images then need a far smaller correction and leave no more structure. A search of the geometry takes a smaller
        pattern, for example, for other focal lengths; beside a wrong effect it finds a wrongly measured rig again."""
        prior = self._fitter.rig_penalty(self._solution)
        by_chance = float(chdtri(1, self._numbers.alpha / RIG_AMPLITUDES))
        open_atoms = [atom for atom in dictionary.atoms if self._is_open(atom.effect)]
        if prior < by_chance or self._evidence.geometry.is_as_stated() or self._is_full() or not open_atoms:
            return False
        before = dict(vars(self))
        effect, values = most_like_rig(dictionary.linear, open_atoms, dictionary.columns)
        space = ParameterSpace.of(self._solution.model.with_effect(effect, **values))
        self._accept(self._fitter.refine(space, space.start, self._solution.phi, 0))
        spared = prior - self._fitter.rig_penalty(self._solution)
        is_spared = spared >= by_chance and local_structure(self._rows) <= self._structure
        gain = self._without(effect.id).sums.total - self._chi2 if is_spared else 0.0
        if gain < self._floor(has_share=False):
            vars(self).update(before)
            return False
        missed = missed_share(effect, False, self._numbers.formula_error)
        self._names.append(Name(effect, {effect.id: 1.0}, gain / self._pixels, missed, None, self._rounds[-1]))
        self._draw_again()
        return True

    def _take_off(self, drawn: Mapping[ImageKey, np.ndarray]) -> None:
        """Subtracts images from the measured ones. drawn: {image key: DN [height][width]}."""
        self._drawn = {key: image + self._drawn.get(key, 0.0) for key, image in drawn.items()}
        self._use_evidence(self._evidence.less(drawn))

    def _fit_again(self, fit: Solution) -> None:
        start, without = ParameterSpace.of(self._given), self._fitter
        if any(Stage.MEDIUM <= n.effect.stage <= Stage.SURFACE for n in self._names):  # albedos would take its place
            prior, tiles = self._evidence.nuisance_prior(_AS_STATED), self._evidence.tiles
            without = Fitter(self._fitter.observations, prior, tiles, memory=self._settings.memory)
        fits = (
            lambda: self._fitter.refine(fit.space, fit.theta, fit.phi, *SETTLING),
            lambda: without.refine(start, start.start, self._first.phi, *SETTLING),
        )
        if self._settings.memory is not None:
            self._settings.memory.make_ahead(lambda make: make(), fits)
        settled, self._first = (make() for make in fits)
        self._solution = refit_free_curve(self._fitter, settled)
        self._rows = self._whole.residuals(self._solution)
        if not any(n.field is not None for n in self._names):
            self._structure_before = local_structure(self._whole.residuals(self._first))

    def _drop_needless(self) -> None:
        """Drops named effects, weakest first, if chi2 hardly rises without them. Random fields and temporal noise are
        never dropped."""
        for name in sorted((n for n in self._names if n.in_model), key=lambda n: n.gain):
            without = self._without(name.id)
            if without.sums.total - self._chi2 < self._floor(has_share=False):
                self._names.remove(name)
                self._needless.add(name.id)
                self._solution = without
                self._rows = self._whole.residuals(without)

    def _without(self, name: str) -> Solution:
        """Returns the fit without one of the named effects."""
        space = ParameterSpace.of(self._solution.model.without_effect(name))
        if len(space.pairs) == len(self._first.space.pairs):
            return self._first
        return self._fitter.refine(space, space.start, self._solution.phi, *SETTLING)

    def _is_full(self) -> bool:
        """Returns whether no further effect may be named."""
        return sum(n.seen is not None for n in self._names) >= self._numbers.most_names
