# SPDX-License-Identifier: Apache-2.0
"""The joint covariance of what `calibrate world` measures, kept in a capture with the names of its parameters.

One solve gives camera and poses, whose covariance is one block; exposures, falloff and black level are another; the
right camera and the projector have their own. Blocks are independent: depth gives the first, light the second.

focal length    relative        turn x|y|z ID, move x|y|z ID    rad, m, of the frame's camera, in its own axes
cx, cy          px              exposure ID                     relative to the first frame's
right column    px              falloff                         n of cos^n
right row       px              black                           DN
baseline        m               projector x|y|z                 m
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from activestereo.capture.capture import Capture
from activestereo.capture.capture_json import CaptureError

_LEAST = 1e-9  # of an eigenvalue, as a share of the variances


def block(parameters: Sequence[str], covariance: NDArray[np.float64]) -> dict[str, Any]:
    """Returns a step's covariance block as a capture stores it, without parameters of zero or infinite variance."""
    known = np.flatnonzero(np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0.0))
    covariance = covariance + np.diag(_LEAST * np.diag(covariance))  # a jackknife over few scenes has not full rank
    return {"parameters": [parameters[k] for k in known], "covariance": covariance[np.ix_(known, known)].tolist()}


def joint_covariance(capture: Capture) -> tuple[list[str], NDArray[np.float64]]:
    """Returns the parameters' names and their covariance, from all steps' blocks; empty if `calibrate world` did not
    measure the capture. Raises CaptureError if a block is no covariance."""
    names, blocks = [], []
    for step, told in capture.measured.items():
        if isinstance(told, dict) and (parameters := told.get("joint", {}).get("parameters")):
            names += parameters
            blocks.append(read_covariance(told["joint"]["covariance"], len(parameters), step, "joint"))
    return names, block_diag(*blocks) if blocks else np.zeros((0, 0))


def read_covariance(told: object, size: int, step: str, name: str) -> NDArray[np.float64]:
    """Returns the covariance [size, size] in a capture's measured.STEP.NAME. Raises CaptureError if it is none."""
    matrix, least = np.array(told, dtype=np.float64), np.nan
    if matrix.shape == (size, size) and np.isfinite(matrix).all() and np.diag(matrix).min() > 0.0:
        scale = np.sqrt(np.diag(matrix))
        least = float(np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0])
    if not least > 0.0 or not np.allclose(matrix, matrix.T):
        raise CaptureError(
            f"measured.{step}.{name}: is no covariance of {size} numbers (symmetric, every eigenvalue positive): run "
            f"calibrate world's step {step} again"
        )
    return matrix
