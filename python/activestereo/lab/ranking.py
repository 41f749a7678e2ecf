"""Ranks candidates: every library effect is fitted with its nuisances and judged on tiles that its fit did not see."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from activestereo.effects import Randomness, Stage
from activestereo.lab.diagnose_constancy import varying_floors
from activestereo.lab.diagnose_depth import DepthEvidence
from activestereo.lab.diagnose_fit import Fitter, Play, signal
from activestereo.lab.diagnose_noise import fit_noise
from activestereo.lab.diagnose_occam import choice_nats, occam_nats
from activestereo.lab.diagnose_scan import scan_observations, starts
from activestereo.lab.diagnose_score import (
    Entry,
    cross_validated,
    design_effect,
    frame_consistency,
    gain_error,
    interval,
    intervals,
    nats_of,
    told,
)
from activestereo.lab.diagnose_static import PARTS, fit_static, white_rest, worst_image
from activestereo.lab.diagnose_surfaces import on_explained
from activestereo.lab.diagnose_verdict import confidences, equivalents, is_significant, is_unexplained, passes
from activestereo.lab.goodness import local_structure
from activestereo.lab.parsimony import simplified

# A fit on the scan's images that gains less than this share of chi2 is not polished on all images.
_WORTH_POLISHING = 2e-4
# And below this one no step is taken there: no effect of practical size is in sight.
_WORTH_STEPS = 4e-3
_POLISH, _SCAN_STEPS = 6, 5
# Polished are the first few, and all whose scan gained this share of the best's; below the other share they are left out.
_POLISHED, _CLOSE, _HOPELESS = 3, 0.4, 0.01
# Explanations that are so many nats behind the best may come first yet.
_CLOSE_NATS = 10.0
# Of so many the error in DN is looked at, and of so many whether they are the same everywhere.
_SIZED, _LOOKED_AT = 5, 8
# A scan knows an effect's gain coarsely: what gains less than this share of the best scan is not fitted.
_OUT_OF_REACH = 0.03
# Parts of the time, for the progress; polishing takes the rest.
_RANDOM_TIME, _SCAN_TIME, _FIT_TIME = 0.05, 0.35, 0.25
# Below this excess, in floors of variance, the infrared images lack nothing.
_AT_FLOOR = 0.12


class Ranking:
    """The base fit and an Entry per candidate: those that may be named first, each part by its gain."""

    def __init__(self, evidence, model, candidates, workers=2, progress=None, alone=None, phi=None):
        """alone: {id: a candidate's parameters as fitted without the model's last effect}, see diagnose_scan.starts. phi: nuisances to
        start from, of a fit near by."""
        self.evidence = evidence
        self._alone = alone or {}
        self._model = model
        self._rows, self._varying = {}, {}
        self.fitter, self._tests, self._scan = evidence.once("fitters", lambda: _fitters(evidence))
        self.pixels = sum(o.measured.size for o in evidence.train)
        self.tile_pixels = np.bincount(np.concatenate([o.tile.ravel() for o in evidence.train]), minlength=evidence.tiles)
        self.base = evidence.once(("base", _key(model)), lambda: self._fit_base(phi))
        self._base_rows = self.rows(evidence.train, self.base.solution)
        self._base_test_rows = self.rows(evidence.test, self.base.solution)
        self.white = white_rest(self._base_rows)
        known = {e.id for e, _ in model.effects}
        chosen = [e for e in candidates if e.id not in known]
        self.entries = self._fit_all([e for e in chosen if e.stage <= Stage.DIGITAL], workers, progress)
        self._score()
        self._size_up()
        self._simplify_best()
        self._look_for_variation()
        self.entries += self._beside([e for e in chosen if e not in {entry.effect for entry in self.entries}])
        self.entries.sort(key=lambda e: (not passes(self, e), e.channel == "depth" and not self.at_floor, -e.nats - e.occam))
        self._put_the_likeliest_first()
        self._prefer_what_leaves_no_structure()

    def _put_the_likeliest_first(self):
        """Among what the images name, by confidence: where gains are alike, what had to be tuned less finely."""
        confidence = confidences(self)
        places = [i for i, e in enumerate(self.entries) if e.channel == "infrared" and passes(self, e)]
        for place, entry in zip(places, sorted((self.entries[i] for i in places), key=lambda e: -confidence[e.id]), strict=True):
            self.entries[place] = entry

    def _prefer_what_leaves_no_structure(self):
        """Of explanations alike one that leaves structure is none: the next of them that leaves none comes first."""
        if not self.entries or not passes(self, self.entries[0]) or not is_unexplained(self, self.entries[0], self):
            return
        alike = equivalents(self, self.entries[0])
        clean = (e for e in self.entries if e.id in alike and passes(self, e) and not is_unexplained(self, e, self))
        if (better := next(clean, None)) is not None:
            self.entries.remove(better)
            self.entries.insert(0, better)

    def _fit_base(self, phi):
        play = Play(self._model)
        solution = self.fitter.refine(play, play.start, self.fitter.phi0(self.evidence.nuisances) if phi is None else phi, _POLISH)
        return Entry(None, cross_validated(self.fitter, solution), solution.sums.tile_chi2, solution)

    def _fit_all(self, candidates, workers, progress):
        """Scans all; fits on the scan's images those that a scan shows to be within reach of the best; polishes on all images those
        that came close to it."""
        done = [0.0]

        def all_of(items, share, work):
            def one(item):
                out = work(item)
                done[0] += share / len(items)
                if progress:
                    progress(min(done[0], 1.0))
                return out

            return [out for out in pool.map(one, items) if out is not None] if items else []

        def best_of(found, share):
            best = max((gain for gain, *_ in found), default=0.0)
            return sorted((f for f in found if f[0] > share * best), key=lambda f: -f[0])

        random = [e for e in candidates if e.id in PARTS]
        smooth = [e for e in candidates if e.randomness is Randomness.NONE and e.id != "quantisation"]
        with ThreadPoolExecutor(max_workers=workers) as pool:
            entries = all_of(random, _RANDOM_TIME, self._fit_random)
            seen = all_of(smooth, _SCAN_TIME, self._look_at)
            scanned = best_of(seen, _OUT_OF_REACH)
            within = {s[1].id for s in scanned}
            scanned += [s for s in seen if s[1].id in self._alone and s[1].id not in within]
            hopeful = best_of(all_of(scanned, _FIT_TIME, self._approach), _HOPELESS)
            jobs = [
                (gain > _WORTH_STEPS and (rank < _POLISHED or gain > _CLOSE * hopeful[0][0]), *rest)
                for rank, (gain, *rest) in enumerate(hopeful)
            ]
            entries += all_of(jobs, 1.0 - _RANDOM_TIME - _SCAN_TIME - _FIT_TIME, self._polish)
        return entries

    def _look_at(self, candidate):
        """(relative gain, candidate, Play, chi2 without it, starts) of a coarse scan; None where there is nothing to see."""
        base = self.base.solution
        play = Play(self._model, candidate)
        play.start[: len(base.theta)] = base.theta
        neutral = self._scan.nuisance_fit(play, play.start, base.phi, self._scan.lights(play, play.start), 1)[1]
        found = [s for s in starts(self._scan, play, candidate, base.phi, self._alone.get(candidate.id)) if s[0] < 1.5 * neutral]
        return (1.0 - found[0][0] / neutral, candidate, play, neutral, found) if found else None

    def _approach(self, scanned):
        """(relative gain, candidate, Solution) of a fit to the scan's images; None where it gains nothing."""
        _, candidate, play, neutral, found = scanned
        best = None
        for _, theta, phi in found:
            solution = self._scan.refine(play, theta, phi, _SCAN_STEPS)
            if best is None or solution.sums.total < best.sums.total:
                best = solution
        best = on_explained(self._scan, best, _SCAN_STEPS)
        gain = 1.0 - best.sums.total / neutral
        return (gain, candidate, best) if gain > _WORTH_POLISHING else None

    def _polish(self, job):
        fully, candidate, start = job
        play = start.play
        solution = self.fitter.refine(play, start.theta, start.phi, _POLISH if fully else 0)
        entry = Entry(candidate, cross_validated(self.fitter, solution), solution.sums.tile_chi2, solution)
        entry.parameters = intervals(self.fitter, solution, len(play.free) - len(candidate.parameters), candidate)
        return entry

    def rows(self, observations, solution):
        """(observation, prediction, projector DN, residual) of each."""
        key = id(solution), observations is self.evidence.train
        if key not in self._rows:
            self._rows[key] = solution, self._rows_of(self.fitter if key[1] else self._tests, solution)
        return self._rows[key][1]

    @staticmethod
    def _rows_of(fitter, solution):
        out = []
        for o, light in zip(fitter.observations, fitter.lights(solution.play, solution.theta), strict=True):
            image = signal(solution.model, o, light, solution.phi)
            dots = solution.phi[0] * o.frame.exposure_gain * o.frame.projector_power * light.direct
            out.append((o, image, dots, o.measured - image))
        return out

    def _fit_random(self, candidate):
        solution, train = self.base.solution, self._base_rows
        if candidate.id == "speckle_static" and not self.white:
            return None
        fit = fit_static(candidate.id, train, self._base_test_rows, solution.nuisances.black_dn)
        if fit is None:
            return None
        tiles = np.zeros(self.evidence.tiles)
        for (o, *_), r in zip(train, fit.residuals, strict=True):
            tiles += np.bincount(o.tile.ravel(), (o.weight * r**2).ravel(), minlength=len(tiles))
        entry = Entry(candidate, float(tiles.sum()), tiles, static=fit)
        found = {}
        for p in candidate.parameters:
            value = fit.share if p.name == "share" else fit.sigma.get(p.name, p.neutral)
            found[p.name] = interval(p, float(np.clip(value, p.low, p.high)), fit.error.get(p.name, 0.0))
        entry.parameters = told(candidate, found)
        return entry

    def _size_up(self):
        """The fall of the error in DN, of the best few fits."""
        fits = sorted((e for e in self.entries if e.solution is not None and is_significant(self, e)), key=lambda e: -e.nats)
        floor = sum(self.evidence.floors[o.key] * o.measured.size for o in self.evidence.train)
        before = _square(self._base_rows)
        for e in fits[:_SIZED]:
            fall = before - _square(self.rows(self.evidence.train, e.solution))
            e.plain_share, e.plain_floors = fall / max(before - floor, 1e-9 * floor), fall / floor

    def _simplify_best(self):
        """The best and those as good as it, alike: a needless parameter costs an explanation a nat or so."""
        passing = [e for e in self.entries if e.solution is not None and passes(self, e)]
        best = max((e.nats for e in passing), default=0.0)
        simple = {id(e): simplified(self.fitter, e, self.base.chi2, self.pixels) for e in passing if e.nats > best - _CLOSE_NATS}
        if simple:
            self.entries = [simple.get(id(e), e) for e in self.entries]
            self._score()

    def _look_for_variation(self):
        """Of the best few fits: what their traces explain where they may vary."""
        fits = sorted((e for e in self.entries if e.solution is not None and passes(self, e)), key=lambda e: -e.nats)
        for e in fits[:_LOOKED_AT]:
            e.varying = self.varying(e.solution, e.effect)

    def varying(self, solution, effect):
        """diagnose_constancy.varying_floors of an effect in a Solution on the train frames."""
        key = id(solution), effect.id
        if key not in self._varying:
            self._varying[key] = varying_floors(self.fitter, self.rows(self.evidence.train, solution), solution, effect)
        return self._varying[key]

    def _beside(self, candidates):
        """Entries of what expected images cannot show: noise from repeats, the depth engine's faults from its disparity."""
        entries = []
        floor = self.evidence.floor_variance(self.evidence.train)
        for candidate in (e for e in candidates if e.stage <= Stage.DIGITAL):
            fit = fit_noise(candidate, self.evidence, self._model)
            if fit is not None:
                share = fit.variance / max(floor, fit.variance)
                entry = self._entry_beside(candidate, "noise", fit.nats, share, 1.0, fit.values)
                if fit.repeats:
                    entry.repeats = fit.variance * float(np.mean([o.weight.mean() for o in self.evidence.train]))
                entries.append(entry)
        engine = [e for e in candidates if e.stage > Stage.DIGITAL]
        if engine and any(o.frame.depth_path is not None for o in self.evidence.train):
            evidence = self._depth_evidence()
            for candidate in engine:
                fit = evidence.fit(candidate)
                if fit is not None:
                    entry = self._entry_beside(candidate, "depth", fit.nats, fit.share, fit.consistency, fit.values)
                    entry.choice = fit.surveyed
                    entries.append(entry)
        return entries

    def _entry_beside(self, candidate, channel, nats, share, consistency, values):
        entry = Entry(candidate, self.base.chi2, self.base.tile_chi2, parameters=told(candidate, values), channel=channel)
        entry.nats, entry.explained, entry.gain_floors, entry.consistency = nats, share, share, consistency
        return entry

    def _depth_evidence(self):
        observations = self.evidence.train
        predictions = {o.key: image for (o, image, *_) in self._base_rows}
        measured, views = {o.key: o.measured for o in observations}, {o.key: o.view for o in observations}
        return DepthEvidence(self.evidence.capture, measured, predictions, views, self.evidence.law, self._model)

    def _score(self):
        base = self.base
        best = min([base, *self.entries], key=lambda e: e.chi2)
        self.deff = design_effect(best.tile_chi2, self.tile_pixels)
        self.floor_chi2 = min(float(self.pixels), best.chi2)
        above = max(base.chi2 - self.floor_chi2, 1e-9)
        for e in self.entries:
            e.nats = nats_of(base.chi2, e.chi2, self.pixels, self.deff)
            e.explained = (base.chi2 - e.chi2) / above
            e.gain_floors = (base.chi2 - e.chi2) / self.pixels
            e.consistency = frame_consistency(self.evidence.train, base.tile_chi2, e.tile_chi2)
            if e.solution is not None:
                e.choice = choice_nats(self.fitter, e)
                e.occam = occam_nats(self.fitter, e, self.deff) - e.choice

    def structure_after(self, entry):
        """goodness.local_structure of what an entry's expected images leave, and of its draws where they are larger than a pixel."""
        rows = self.rows(self.evidence.train, (entry.solution or self.base.solution))
        if entry.static is not None and entry.static.extended:
            rows = [(*row[:3], r) for row, r in zip(rows, entry.static.residuals, strict=True)]
        return local_structure(rows)

    @property
    def worst_image(self):
        """diagnose_static.worst_image of what the base model leaves."""
        return worst_image(self._base_rows)

    @property
    def at_floor(self):
        """Whether the expected images lack nothing."""
        return self.excess < _AT_FLOOR

    @property
    def excess(self):
        """What the base model leaves above the floor and the renderer's own noise, in floors of variance."""
        return self.base.chi2 / self.pixels - 1.0 - self.white

    def difference_error(self, first, second):
        """Standard error of the difference of two entries' nats."""
        return gain_error(first, second, self.deff, min(first.chi2, second.chi2), self.pixels)


def _fitters(evidence):
    """Of the train images, the test images and a scan's."""
    observations = evidence.train, evidence.test, scan_observations(evidence.train)
    return [Fitter(o, evidence.held_sigma, evidence.tiles, fine=o is not observations[2]) for o in observations]


def _key(model):
    return tuple((e, tuple(values.items())) for e, values in model.effects)


def _square(rows):
    return float(sum((r.astype(np.float64) ** 2).sum() for *_, r in rows))
