# SPDX-License-Identifier: Apache-2.0
"""The places of a model's failure: the residual against each covariate, binned, with block-bootstrap intervals and
a false discovery rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from activestereo.compare.bootstrap import BlockBootstrap, benjamini_yekutieli, interval, max_t
from activestereo.compare.covariates import COVARIATES
from activestereo.compare.where_samples import GROUPS, Samples

FALSE_DISCOVERY_RATE = 0.05
# Statistical certainty is not size: a table is shown as a finding if it moves at least this share of the explainable
# error.
SMALLEST_SHARE = 0.05


def where_tables(
    channels: Mapping[str, tuple[Samples, str, bool]], name_of: Callable[[Any], str] = str, seed: int = 0
) -> list[dict[str, Any]]:
    """The `where` list of compare.json: a table per channel and covariate, findings first, larger first.

    channels: {name: (Samples, unit, is there anything to explain)}. name_of(material id) -> text.
    """
    bootstrap = BlockBootstrap(GROUPS, seed=seed)
    tables = [
        _table(channel, unit, samples, explainable, covariate, bootstrap, name_of)
        for channel, (samples, unit, explainable) in channels.items()
        for covariate in COVARIATES
        if covariate.name in samples.bins
    ]
    for table, q in zip(tables, benjamini_yekutieli([t["p_value"] for t in tables]), strict=True):
        table["q_value"] = float(q)
        table["is_finding"] = bool(q <= FALSE_DISCOVERY_RATE and (table["concentration"] or 0.0) >= SMALLEST_SHARE)
    order = list(channels)
    return sorted(tables, key=lambda t: (order.index(t["channel"]), not t["is_finding"], -(t["concentration"] or 0.0)))


def _table(
    channel: str, unit: str, samples: Any, explainable: bool, covariate: Any, bootstrap: Any, name_of: Any
) -> dict[str, Any]:
    bins = samples.bins[covariate.name]
    ones = np.ones_like(samples.residual)
    sums = lambda values: samples.group_sums(values, bins.code, bins.count)  # noqa: E731
    pixels = sums(ones)
    values = (samples.residual, samples.excess)
    (mean, mean_draws), (excess, excess_draws) = columns = bootstrap.ratios([sums(v) for v in values], pixels)
    overall = bootstrap.ratios([samples.group_sums(v) for v in values], samples.group_sums(ones))
    p_value = _p_value(columns, overall)
    count = pixels.sum(0)
    floor = sums(samples.floor).sum(0) / np.maximum(count, 1)
    share = count / count.sum()
    total = np.nansum(share * excess)
    concentration = mean_share = None
    if explainable and total > 0:  # pixels without this covariate may hold all of it
        concentration = float(np.nansum(np.maximum(share * excess / total - share, 0.0)))
        mean_share = float(np.nansum(share * np.maximum(mean**2 - np.nanvar(mean_draws, axis=0), 0.0)) / total)
    return {
        "channel": channel,
        "unit": unit,
        "covariate": covariate.name,
        "covariate_unit": covariate.unit,
        "concentration": concentration,
        "mean_share": mean_share,
        "p_value": p_value,
        "bins": _bin_rows(covariate, bins, name_of, count, share, (mean, mean_draws), (excess, excess_draws), floor),
    }


def _p_value(columns: np.ndarray, overall: Any) -> float:
    """The p value of the hypothesis that the covariate does not matter: in every bin the mean residual and the excess
    are the overall ones."""
    observed, drawn = 0.0, np.zeros(1)
    for (value, draws), (all_value, all_draws) in zip(columns, overall, strict=True):
        t, t_draws = max_t(value - all_value, draws - all_draws)
        observed, drawn = max(observed, t), np.maximum(drawn, t_draws)
    return float((1 + np.count_nonzero(drawn >= observed)) / (1 + np.size(drawn)))


def _bin_rows(
    covariate: Any,
    bins: Any,
    name_of: Any,
    count: np.ndarray,
    share: np.ndarray,
    mean: tuple[np.ndarray, np.ndarray],
    excess: tuple[np.ndarray, np.ndarray],
    floor: np.ndarray,
) -> list[dict[str, Any]]:
    mean_low, mean_high = interval(mean[1])
    excess_low, excess_high = interval(excess[1])
    rows = []
    for i in np.flatnonzero(count):
        if covariate.is_category:
            place = {"label": name_of(int(bins.values[i]))}
        elif bins.edges is None:
            place = {"low": float(bins.values[i]), "high": float(bins.values[i])}
        else:
            place = {"low": float(bins.edges[i]), "high": float(bins.edges[i + 1])}
        rows.append(
            place
            | {
                "pixels": int(count[i]),
                "mean": float(mean[0][i]),
                "mean_interval": [float(mean_low[i]), float(mean_high[i])],
                "rmse": float(np.sqrt(max(0.0, excess[0][i] + floor[i]))),
                "noise_floor": float(np.sqrt(max(0.0, floor[i]))),
                "excess": float(excess[0][i]),
                "excess_interval": [float(excess_low[i]), float(excess_high[i])],
            }
        )
    return rows
