# SPDX-License-Identifier: Apache-2.0
"""Predictions of each view by the others: a true effect has the same parameters everywhere, a stand-in has not."""

from collections.abc import Sequence

import numpy as np

from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.diagnose.evidence.observation import Observation
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.parameter_space import Solution

# Other views tell nothing of what only one sees, but for rounding.
_NOTHING = 1e-9

View = tuple[bytes, bool]


def view_of(o: Observation) -> View:
    """The view of an image: the pose that it shares with the other camera, repeats and settings."""
    return o.frame.camera_to_world.tobytes(), o.frame.is_moving


def views(observations: Sequence[Observation]) -> list[View]:
    """The views in their order."""
    return list(dict.fromkeys(map(view_of, observations)))


def left_out_by_view(fitter: Fitter, solution: Solution) -> list[float]:
    """chi2 of each view with all that views share as the others have it, by the linearisation at the solution; the
    view's own pose is fitted to it. One view alone: as fitted."""
    by_view = fitter.sums_by(solution, view_of)
    if len(by_view) < 2:
        return [sums.total for sums in by_view.values()]  # no other view tells anything
    n, space = len(solution.theta), solution.space
    prior, pull = np.diag(fitter.prior(n, space)), fitter.pull(solution.phi, n, space, solution.theta)
    whole, slope = (sum(getattr(sums, name).sum(0) for sums in by_view.values()) for name in ("gram", "moment"))
    out = []
    for sums in by_view.values():
        gram, moment = sums.gram.sum(0), sums.moment.sum(0)
        others = whole - gram
        step = inverse_normal_matrix(others + prior) @ (slope - moment - pull)
        own = (np.diag(gram) > 0.0) & (np.diag(others) <= _NOTHING * np.diag(gram))
        step[own] = 0.0
        step[own] = inverse_normal_matrix((gram + prior)[np.ix_(own, own)]) @ (moment - pull - gram @ step)[own]
        out.append(float(sums.total - 2.0 * step @ moment + step @ gram @ step))
    return out
