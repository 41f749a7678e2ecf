# SPDX-License-Identifier: Apache-2.0
"""Whether the amplitude of a named effect is the same in all images. An effect's formula predicts its signature, the
change of the expected images, at every pixel; a confounder fits the true effect only with an amplitude that varies.

A varying-coefficient model (Hastie and Tibshirani 1993) lets the amplitude vary over the picture, from frame to frame
and from camera to camera. What it explains beyond one amplitude is due to another effect or to errors of the scene
measurement.
"""

from collections.abc import Sequence

import numpy as np

from activestereo.diagnose.refine.fitter import Fitter, ImageResidual, signal
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.effects import Effect

# Columns that all images share: offset, gain and signature, then the signature times polynomials of the position and
# that of the right camera. Each frame has one more.
_ALIKE, _SHARED = 3, 9


def varying_reduced_chi2(fitter: Fitter, rows: Sequence[ImageResidual], solution: Solution, effect: Effect) -> float:
    """Mean square per pixel, in noise variances, that an effect's signature explains with a varying amplitude beyond
    what it explains with one.

    The amplitude is a second-order polynomial of the position, plus an offset for every frame and for the right camera.
    rows: of the Fitter's observations.
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
    return (_explained(gram, moment) - alike) / sum(row.observation.pixels for row in rows)


def _without(fitter: Fitter, solution: Solution, effect: Effect) -> list[np.ndarray]:
    """Expected images without the effect, all else alike."""
    own = np.array([e.id == effect.id for e, _ in solution.space.pairs])
    theta = np.where(own, solution.space.neutral, solution.theta)
    model, lights = solution.space.model(theta), fitter.lights(solution.space, theta)
    return [signal(model, o, light, solution.phi) for o, light in zip(fitter.observations, lights, strict=True)]


def _varying(signature: np.ndarray, is_right: float) -> list[np.ndarray]:
    height, width = signature.shape
    u, v = np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height)[:, None]
    return [signature * f for f in (1.0, u, v, u * u, u * v, v * v, is_right, 1.0)]


def _explained(gram: np.ndarray, moment: np.ndarray) -> float:
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-30))
    return float(
        moment / norm @ np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-9, hermitian=True) @ (moment / norm)
    )
