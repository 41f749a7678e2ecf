# SPDX-License-Identifier: Apache-2.0
"""Views predicted by the others, against least squares that sees the others alone."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.diagnose.score.left_out import left_out_by_view


@pytest.mark.parametrize("count", [1, 3])
def test_each_view_is_predicted_by_what_the_others_tell(count):
    """Two shared parameters, and one of its own for each view, all with priors around values that are not zero."""
    rng, size = np.random.default_rng(5), 2 + count
    precision, stated, here = np.full(size, 0.3), rng.normal(size=size), rng.normal(size=size)
    columns, values, by_view = [], [], {}
    for view in range(count):
        x = np.zeros((20, size))
        x[:, [0, 1, 2 + view]] = rng.normal(size=(20, 3))
        y = x @ rng.normal(size=size) + rng.normal(size=20)
        rest = y - x @ here
        by_view[view] = SimpleNamespace(gram=(x.T @ x)[None], moment=(x.T @ rest)[None], total=float(rest @ rest))
        columns.append(x)
        values.append(y)
    fitter = SimpleNamespace(
        sums_by=lambda *_: by_view, prior=lambda *_: precision, pull=lambda *_: precision * (here - stated)
    )
    found = left_out_by_view(fitter, SimpleNamespace(theta=np.zeros(0), phi=here, space=None))
    if count == 1:
        assert found == [by_view[0].total]
        return
    for view in range(count):
        x, y = (np.concatenate(parts[:view] + parts[view + 1 :]) for parts in (columns, values))
        theta = np.linalg.solve(x.T @ x + np.diag(precision), x.T @ y + precision * stated)
        own, x, y = 2 + view, columns[view], values[view]
        rest = y - x[:, :2] @ theta[:2]
        column = x[:, own]
        theta[own] = (column @ rest + precision[own] * stated[own]) / (column @ column + precision[own])
        assert found[view] == pytest.approx(((y - x @ theta) ** 2).sum())
