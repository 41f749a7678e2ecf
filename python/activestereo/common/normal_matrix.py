# SPDX-License-Identifier: Apache-2.0
"""The inverse of a least-squares fit's normal matrix."""

import numpy as np


def inverse_normal_matrix(gram: np.ndarray) -> np.ndarray:
    """The pseudo-inverse of a normal matrix [n][n], computed with columns of unit norm, since parameters' units differ.
    A column of zeros gives zeros."""
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    return np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-12, hermitian=True) / np.outer(norm, norm)
