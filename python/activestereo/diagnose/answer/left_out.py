# SPDX-License-Identifier: Apache-2.0
"""The error of frames left out in turn, where a capture keeps no test frames."""

import numpy as np

from activestereo.diagnose.refine import Fitter, Solution
from activestereo.diagnose.search.linear import linearised


def left_out_rmse(fitter: Fitter, solution: Solution) -> float:
    """Root mean square, DN, of each frame's residual under the parameters and nuisances of all other frames, by the
    linear model at a solution. Pixels that the scene does not show count nowhere."""
    linear, weight = linearised(fitter, solution), np.concatenate([p.root_weight for p in fitter.pixels()])
    frame = np.concatenate([np.full(len(p.index), p.observation.frame.id) for p in fitter.pixels()])
    A, r = linear.nuisances, linear.residual
    gram, moment = (A @ A.T).astype(np.float64) + np.diag(linear.precision), (A @ r).astype(np.float64) - linear.pull
    squares = count = 0.0
    for number in np.unique(frame):
        here = np.flatnonzero((frame == number) & (weight > 0.0))
        own, rest = A[:, here], r[here]
        kept, norm = gram - own @ own.T, np.sqrt(np.maximum(np.diag(gram), 1e-300))
        step = np.linalg.lstsq(kept / np.outer(norm, norm), (moment - own @ rest) / norm, rcond=1e-9)[0] / norm
        squares += float((((rest - step @ own) / weight[here]) ** 2).sum())
        count += here.size
    return float(np.sqrt(squares / max(count, 1.0)))
