# SPDX-License-Identifier: Apache-2.0
"""The channel of expected images: an effect is fitted with all nuisances, and judged on tiles that its fit did not
see.

All effects are scanned coarsely on a few images; those that a scan shows to be within reach of the best are fitted
there; those that came close to it are polished on all images.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from threading import Lock
from typing import ClassVar, TypeVar

import numpy as np

from activestereo.diagnose.channels.channel import JudgingChannel, Progress
from activestereo.diagnose.findings import BaseFit, Explanation, NotRanked
from activestereo.diagnose.propose.scan import Start, starts
from activestereo.diagnose.propose.surfaces import on_explained
from activestereo.diagnose.refine import Fitters, ParameterSpace, Solution
from activestereo.diagnose.refine.fit_cache import FitCache, NotKnown
from activestereo.diagnose.refine.fitter import MOST_THREADS
from activestereo.diagnose.refine.parallel_prefit import parallel_prefit
from activestereo.diagnose.score.intervals import intervals
from activestereo.diagnose.score.likelihood import cross_validated
from activestereo.diagnose.thresholds import Thresholds
from activestereo.effects import Effect
from activestereo.effects.core.judging import Channel

_SCAN_STEPS, _POLISH_STEPS = 5, 6
# A start that is worse than the neutral one by this factor is none.
_HOPELESS_START = 1.5
# Parts of the time, for the progress; polishing takes the rest.
_SCAN_TIME, _FIT_TIME = 0.4, 0.3

_In = TypeVar("_In")
_Out = TypeVar("_Out")
_Likely = TypeVar("_Likely", "_Scanned", "_Approached")


@dataclass(frozen=True)
class _Scanned:
    """gain: relative fall of chi2. found: where fits start."""

    gain: float
    effect: Effect
    space: ParameterSpace
    found: tuple[Start, ...]


@dataclass(frozen=True)
class _Approached:
    """A fit to the scan's images."""

    gain: float
    effect: Effect
    solution: Solution


class ExpectedImageChannel(JudgingChannel):
    """Judges deterministic effects up to the digital numbers.

    earlier: {id: an effect's parameters as fitted without the model's last effect}, see propose/scan.py. workers:
    processes that fit.
    """

    kind: ClassVar[Channel] = Channel.EXPECTED_IMAGE

    def __init__(
        self,
        fitters: Fitters,
        base: BaseFit,
        thresholds: Thresholds,
        workers: int,
        earlier: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        self._fitters, self._base, self._thresholds, self._workers = fitters, base, thresholds, workers
        self._earlier = earlier or {}
        # chi2 of the scan's images without the effect: with nuisances refitted as by scans, and with all as by fits.
        space, phi = ParameterSpace.of(base.model).starting_at(base.solution.theta), base.solution.phi
        scan = fitters.scan
        self._neutral = scan.nuisance_fit(space, space.start, phi, scan.lights(space, space.start), 1)[1]
        self._refitted = scan.refine(space, space.start, phi, _SCAN_STEPS).sums.total

    def explain(self, effects: Sequence[Effect], progress: Progress | None = None) -> list[Explanation | NotRanked]:
        thresholds, steps = self._thresholds, _Steps(self._fitters.train.memory, self._workers, progress)
        seen = steps.all_of(effects, _SCAN_TIME, self._scanned)
        within = {s.effect.id for s in _close_to_best(seen, thresholds.out_of_reach)} | set(self._earlier)
        scanned = sorted((s for s in seen if s.effect.id in within), key=lambda s: -s.gain)
        approached = steps.all_of(scanned, _FIT_TIME, self._approached)
        hopeful = _close_to_best(approached, thresholds.hopeless_share)
        jobs = [(self._is_worth_steps(rank, a, hopeful[0].gain), a) for rank, a in enumerate(hopeful)]
        return steps.all_of(jobs, 1.0 - _SCAN_TIME - _FIT_TIME, self._polished)

    def _is_worth_steps(self, rank: int, approached: _Approached, best: float) -> bool:
        thresholds = self._thresholds
        return approached.gain > thresholds.worth_steps and (
            rank < thresholds.polished or approached.gain > thresholds.close_share * best
        )

    def _scanned(self, effect: Effect) -> _Scanned | None:
        """A coarse scan; None where there is nothing to see."""
        base, scan = self._base.solution, self._fitters.scan
        space = ParameterSpace.of(self._base.model, effect).starting_at(base.theta)
        limit = _HOPELESS_START * self._neutral
        found = tuple(starts(scan, space, effect, base.phi, limit, self._earlier.get(effect.id)))
        return _Scanned(1.0 - found[0].chi2 / self._neutral, effect, space, found) if found else None

    def _approached(self, scanned: _Scanned) -> _Approached | None:
        """The best fit to the scan's images; None where it gains nothing."""
        scan = self._fitters.scan
        fits = [scan.refine(scanned.space, s.theta, s.phi, _SCAN_STEPS) for s in scanned.found]
        best = on_explained(scan, min(fits, key=lambda fit: fit.sums.total), _SCAN_STEPS)
        gain = 1.0 - best.sums.total / self._refitted
        return _Approached(gain, scanned.effect, best) if gain > self._thresholds.worth_polishing else None

    def _polished(self, job: tuple[bool, _Approached]) -> Explanation:
        takes_steps, approached = job
        fitter, effect, start, base = self._fitters.train, approached.effect, approached.solution, self._base.solution
        if takes_steps:
            solution = fitter.refine(start.space, start.theta, start.phi, _POLISH_STEPS)
        else:  # linear, from where the base fits all images: the few of the scan pull what is fitted there away from it
            theta = np.concatenate([base.theta, start.theta[len(base.theta) :]])
            solution = fitter.refine(start.space, theta, base.phi, 0)
        parameters, chi2 = intervals(fitter, solution, effect), cross_validated(fitter, solution)
        return Explanation(effect, self.kind, parameters, chi2, solution.sums.tile_chi2, solution=solution)


def _close_to_best(found: Sequence[_Likely], share: float) -> list[_Likely]:
    """Those with more than a share of the best one's gain, best first."""
    best = max((f.gain for f in found), default=0.0)
    return sorted((f for f in found if f.gain > share * best), key=lambda f: -f.gain)


class _Steps:
    """Work by all workers, with the progress of the whole."""

    def __init__(self, memory: FitCache | None, workers: int, progress: Progress | None) -> None:
        self._memory, self._workers, self._progress = memory, workers, progress
        self._done, self._lock = 0.0, Lock()

    def all_of(self, items: Sequence[_In], share: float, work: Callable[[_In], _Out | None]) -> list[_Out]:
        """The results that are not None, in order. share: of the whole time."""
        outs: dict[int, _Out | None] = {}
        counted: set[int] = set()

        def count(i: int) -> None:
            with self._lock:
                if i not in counted:
                    counted.add(i)
                    self._done = min(self._done + share / len(items), 1.0)
                    if self._progress:
                        self._progress(self._done)

        def one(i: int) -> None:
            outs[i] = work(items[i])
            count(i)

        if self._memory is not None:
            for i in range(len(items)):
                with suppress(NotKnown):
                    self._memory.by_known(partial(one, i))
            new = [i for i in range(len(items)) if i not in outs]
            parallel_prefit(self._memory, work, [items[i] for i in new], self._workers, lambda n: count(new[n]))
        with ThreadPoolExecutor(min(self._workers, MOST_THREADS)) as pool:
            list(pool.map(one, (i for i in range(len(items)) if i not in outs)))
        return [out for i in range(len(items)) if (out := outs[i]) is not None]
