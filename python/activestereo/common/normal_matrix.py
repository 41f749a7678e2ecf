# SPDX-License-Identifier: Apache-2.0
"""Inverts the normal matrix of a least-squares fit."""

import numpy as np


def inverse_normal_matrix(gram: np.ndarray) -> np.ndarray:
    """Computes the pseudo-inverse of a normal matrix [n][n]. It first scales columns to unit norm, since parameters
    have different units. A column of zeros stays zero."""
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    return np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-12, hermitian=True) / np.outer(norm, norm)
