# SPDX-License-Identifier: Apache-2.0
"""Is what was found the same everywhere? An effect's law tells its trace at every pixel; a stand-in's amplitude
has to vary.

A varying-coefficient model (Hastie and Tibshirani 1993): the trace, what the effect changes in the expected images,
may grow and fade over the picture, from frame to frame and from camera to camera. What that explains more is another
law's, or errors of the scene measurement.
"""

from collections.abc import Sequence

import numpy as np

from activestereo.diagnose.refine.fitter import Fitter, ImageResidual, signal
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.effects import Effect

# Columns that all images share: offset, gain and trace, then the trace over the picture and of the right camera. Each
# frame has one more.
_ALIKE, _SHARED = 3, 9


def varying_reduced_chi2(fitter: Fitter, rows: Sequence[ImageResidual], solution: Solution, effect: Effect) -> float:
    """Mean square per pixel, in noise variances, that an effect's trace explains with a varying amplitude beyond what
    it explains with one.

    The amplitude is a second-order polynomial of the place, and of its own in every frame and camera. rows: of the
    Fitter's observations.
    """
    frames = {name: i for i, name in enumerate(dict.fromkeys(o.frame.id for o, *_ in rows))}
    size = _SHARED + len(frames)
    gram, moment = np.zeros((size, size)), np.zeros(size)
    for (o, image, _, residual), plain in zip(rows, _without(fitter, solution, effect), strict=True):
        columns = [np.ones(image.shape), plain, *_varying(image - plain, float(o.side == "right"))]
        places = [*range(_SHARED), _SHARED + frames[o.frame.id]]
        x = np.stack([c.ravel() for c in columns]) * np.sqrt(o.weight).ravel()
        gram[np.ix_(places, places)] += x @ x.T
        moment[places] += x @ (residual * np.sqrt(o.weight)).ravel()
    alike = _explained(gram[:_ALIKE, :_ALIKE], moment[:_ALIKE])
    return (_explained(gram, moment) - alike) / sum(row[3].size for row in rows)


def _without(fitter: Fitter, solution: Solution, effect: Effect) -> list[np.ndarray]:
    """Expected images without the effect, all else alike."""
    own = np.array([e.id == effect.id for e, _ in solution.space.pairs])
    theta = np.where(own, solution.space.neutral, solution.theta)
    model, lights = solution.space.model(theta), fitter.lights(solution.space, theta)
    return [signal(model, o, light, solution.phi) for o, light in zip(fitter.observations, lights, strict=True)]


def _varying(trace: np.ndarray, is_right: float) -> list[np.ndarray]:
    height, width = trace.shape
    u, v = np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height)[:, None]
    return [trace * f for f in (1.0, u, v, u * u, u * v, v * v, is_right, 1.0)]


def _explained(gram: np.ndarray, moment: np.ndarray) -> float:
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-30))
    return float(
        moment / norm @ np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-9, hermitian=True) @ (moment / norm)
    )
