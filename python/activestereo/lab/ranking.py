"""Ranks candidates: every library effect is fitted with its nuisances and judged on tiles that its fit did not see."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from activestereo.effects import Randomness, Stage
from activestereo.lab.diagnose_fit import Fitter, Play, signal
from activestereo.lab.diagnose_scan import scan_observations, starts
from activestereo.lab.diagnose_score import (
    Entry,
    cross_validated,
    design_effect,
    frame_consistency,
    gain_error,
    intervals,
    nats_of,
)
from activestereo.lab.diagnose_static import PARTS, fit_static, white_rest

# A fit on the scan's images that gains less than this share of chi2 is not polished on all images.
_WORTH_POLISHING = 2e-4
_POLISH, _SCAN_STEPS = 6, 5
# Polished are the first few, and all whose scan gained this share of the best's; below the other share they are left out.
_POLISHED, _CLOSE, _HOPELESS = 3, 0.4, 0.01
# Part of the time that scans take, for the progress.
_SCAN_TIME = 0.75
_Z90 = 1.645


class Ranking:
    """The base fit and an Entry per candidate, best first."""

    def __init__(self, evidence, model, candidates, workers=2, progress=None):
        self.evidence = evidence
        self._model = model
        self.fitter = Fitter(evidence.train, evidence.albedo_sigma, evidence.tiles)
        self._scan = Fitter(scan_observations(evidence.train), evidence.albedo_sigma, evidence.tiles, fine=False)
        self.pixels = sum(o.measured.size for o in evidence.train)
        self.tile_pixels = np.bincount(np.concatenate([o.tile.ravel() for o in evidence.train]), minlength=evidence.tiles)
        self.base = self._fit_base()
        self.white = white_rest(self.rows(evidence.train, self.base.solution))
        known = {e.id for e, _ in model.effects}
        chosen = [e for e in candidates if e.id not in known and e.stage <= Stage.DIGITAL]
        self.entries = self._fit_all(chosen, workers, progress)
        self._score()

    def _fit_base(self):
        play = Play(self._model)
        solution = self.fitter.refine(play, play.start, self.fitter.phi0(self.evidence.nuisances), _POLISH)
        return Entry(None, cross_validated(self.fitter, solution), solution.sums.tile_chi2, solution)

    def _fit_all(self, candidates, workers, progress):
        """Scans all, then polishes on all images those that came close to the best; the hopeless are left out."""
        done = [0]

        def tracked(share, work):
            def one(item):
                out = work(item)
                done[0] += share
                if progress:
                    progress(min(done[0], 1.0))
                return out

            return one

        with ThreadPoolExecutor(max_workers=workers) as pool:
            scanned = list(pool.map(tracked(_SCAN_TIME / max(len(candidates), 1), self._look_at), candidates))
            random = [entry for entry in scanned if isinstance(entry, Entry)]
            hopeful = sorted((s for s in scanned if isinstance(s, tuple)), key=lambda s: -s[0])
            hopeful = [s for s in hopeful if s[0] > _HOPELESS * hopeful[0][0]]
            jobs = [(rank < _POLISHED or gain > _CLOSE * hopeful[0][0], *rest) for rank, (gain, *rest) in enumerate(hopeful)]
            return random + list(pool.map(tracked((1 - _SCAN_TIME) / max(len(jobs), 1), self._polish), jobs))

    def _look_at(self, candidate):
        """An Entry of a random effect; (relative gain, candidate, Solution) of a scan; None where there is nothing to see."""
        if candidate.id in PARTS:
            return self._fit_random(candidate)
        if candidate.randomness is not Randomness.NONE:
            return None  # temporal noise is a matter of variances, not of expected images
        base = self.base.solution
        play = Play(self._model, candidate)
        play.start[: len(base.theta)] = base.theta
        neutral = self._scan.nuisance_fit(play, play.start, base.phi, self._scan.lights(play, play.start), 1)[1]
        best = None
        for chi2, theta, phi in starts(self._scan, play, candidate, base.phi):
            if chi2 > 1.5 * neutral:
                continue
            solution = self._scan.refine(play, theta, phi, _SCAN_STEPS)
            if best is None or solution.sums.total < best.sums.total:
                best = solution
        if best is None or best.sums.total > neutral * (1.0 - _WORTH_POLISHING):
            return None
        return 1.0 - best.sums.total / neutral, candidate, best

    def _polish(self, job):
        fully, candidate, start = job
        play = start.play
        solution = self.fitter.refine(play, start.theta, start.phi, _POLISH if fully else 0)
        entry = Entry(candidate, cross_validated(self.fitter, solution), solution.sums.tile_chi2, solution)
        deff = design_effect(entry.tile_chi2, self.tile_pixels)
        first = len(play.free) - len(candidate.parameters)
        entry.parameters = intervals(solution, self.fitter, first, candidate, deff, self.pixels)
        return entry

    def rows(self, observations, solution):
        """(observation, prediction, projector DN, residual) of each."""
        lights = Fitter(observations, self.evidence.albedo_sigma, self.evidence.tiles).lights(solution.play, solution.theta)
        out = []
        for o, light in zip(observations, lights, strict=True):
            image = signal(solution.model, o, light, solution.phi)
            dots = solution.phi[0] * o.frame.exposure_gain * o.frame.projector_power * light.direct
            out.append((o, image, dots, o.measured - image))
        return out

    def _fit_random(self, candidate):
        solution = self.base.solution
        train = self.rows(self.evidence.train, solution)
        if candidate.id == "speckle_static" and not self.white:
            return None
        fit = fit_static(candidate.id, train, self.rows(self.evidence.test, solution), solution.nuisances.black_dn)
        if fit is None:
            return None
        tiles = np.zeros(self.evidence.tiles)
        for (o, *_), r in zip(train, fit.residuals, strict=True):
            tiles += np.bincount(o.tile.ravel(), (o.weight * r**2).ravel(), minlength=len(tiles))
        entry = Entry(candidate, float(tiles.sum()), tiles, static=fit)
        for p in candidate.parameters:
            value = fit.share if p.name == "share" else fit.sigma.get(p.name, p.neutral)
            error = _Z90 * fit.error.get(p.name, 0.0)
            value = float(np.clip(value, p.low, p.high))
            low, high = max(p.low, value - error), min(p.high, value + error)
            entry.parameters[p.name] = {"value": value, "low": low, "high": high, "unit": p.unit}
        return entry

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
        self.entries.sort(key=lambda e: -e.nats)

    def white_after(self, entry):
        """white_rest of what an entry leaves."""
        if entry is self.base or entry.solution is None:
            return self.white
        return white_rest(self.rows(self.evidence.train, entry.solution))

    @property
    def excess(self):
        """What the base model leaves above the floor and the renderer's own noise, in floors of variance."""
        return self.base.chi2 / self.pixels - 1.0 - self.white

    def difference_error(self, first, second):
        """Standard error of the difference of two entries' nats."""
        return gain_error(first, second, self.deff, min(first.chi2, second.chi2), self.pixels)
