# SPDX-License-Identifier: Apache-2.0
"""Finds where a model fails: tables of the residual, binned by each covariate, with block-bootstrap intervals and a
false discovery rate.

There are three channels: infrared (DN), disparity (px, at pixels that device and model both measured), validity (1 =
only the device measured, -1 = only the model). Each is a list of pixels with residual, covariates, bins and blocks. A
covariate is a known quantity of each pixel, such as depth; NaN = not defined there (the sky has no depth). Pixels are
not independent, so whole blocks of the image are resampled (Efron and Tibshirani, An Introduction to the Bootstrap,
1993, ch. 8; Benjamini and Yekutieli, Annals of Statistics 29, 2001)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from activestereo.capture.images import block_numbers
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.view import View

# Neighbours whose depths differ by more than this share form an edge.
_EDGE_STEP = 0.03


@dataclass(frozen=True)
class Covariate:
    """Describes a covariate. name: as in compare.json; words: for a reader; unit: '' for pure numbers; is_category: its
    values have no order."""

    name: str
    words: str
    unit: str
    is_category: bool = False


COVARIATES = (
    Covariate("depth", "depth", "m"),
    Covariate("radius", "radius", "of the half diagonal"),
    Covariate("column", "column", "px"),
    Covariate("row", "row", "px"),
    Covariate("incidence", "viewing angle", "deg"),
    Covariate("material", "material", "", is_category=True),
    Covariate("pattern_irradiance", "pattern irradiance", "1/m²"),
    Covariate("intensity", "expected signal", "DN"),
    Covariate("velocity", "image speed", "px/s"),
    Covariate("time", "time", "s"),
    Covariate("temperature", "temperature", "°C"),
    Covariate("exposure", "exposure x gain", "ms"),
    Covariate("disparity_fraction", "disparity fraction", "px"),
    Covariate("edge_distance", "distance to a depth edge", "px"),
)


def covariate_maps(
    view: View, material: np.ndarray, predicted_dn: np.ndarray, baseline_m: float
) -> dict[str, np.ndarray]:
    """Returns {covariate: float32 [height][width]} of one image. view: the camera's View of the scene; material: ids
    [height][width]; predicted_dn: the expected image."""
    height, width = view.shape
    u, v = view.pixels()
    seen = view.depth_m > 0
    depth = np.where(seen, view.depth_m, np.nan)
    frame, points = view.frame, view.points()
    # 1. The angle between the ray to the camera and the surface's normal.
    distance = np.linalg.norm(points, axis=-1)
    cosine = np.abs((points * view.normal).sum(-1)) / np.where(distance > 0, distance, 1.0)
    incidence_deg = np.where(seen, np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0))), np.nan)
    # 2. The nominal projector's pattern x cos / d^2 at the surface, times the frame's power, shadows aside.
    way = np.linalg.inv(view.camera_to_projector)[:3, 3] - points
    distance = np.linalg.norm(way, axis=-1)
    cosine = np.maximum((way * view.normal).sum(-1), 0.0) / np.maximum(distance, 1e-9)
    irradiance = frame.projector_power * DotView.of(view).nominal() * cosine / np.maximum(distance, 1e-9) ** 2
    # 3. The image speed of the static scene, pixels per second: the optical flow that the rig's motion causes.
    speed: Any = 0.0
    if frame.is_moving:
        velocity, spin = view.left_to_camera[:3, :3] @ frame.camera_velocity.reshape(2, 3, 1)
        velocity, spin = velocity.ravel(), spin.ravel()
        velocity = velocity + np.cross(spin, -view.left_to_camera[:3, 3])
        flow = -(velocity + np.cross(spin, points))
        du = view.K[0, 0] * (flow[..., 0] - flow[..., 2] * points[..., 0] / depth) / depth
        dv = view.K[1, 1] * (flow[..., 1] - flow[..., 2] * points[..., 1] / depth) / depth
        speed = np.hypot(du, dv)
    # 4. The distance to the nearest jump in depth, pixels; the image's size without one.
    z = np.where(seen, view.depth_m, np.inf)
    edge = np.zeros(z.shape, dtype=bool)
    neighbours: Any = ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]))
    for near, far in neighbours:
        low, high = np.minimum(z[near], z[far]), np.maximum(z[near], z[far])
        jump = np.isfinite(low) & (high > (1.0 + _EDGE_STEP) * low)
        edge[near] |= jump
        edge[far] |= jump
    maps = {
        "depth": depth,
        "radius": np.hypot(u - (width - 1) / 2, v - (height - 1) / 2) / np.hypot((width - 1) / 2, (height - 1) / 2),
        "column": u,
        "row": v,
        "incidence": incidence_deg,
        "material": np.where(seen, material, np.nan),
        "pattern_irradiance": np.where(seen, irradiance, np.nan),
        "intensity": predicted_dn,
        "velocity": speed,
        "time": frame.timestamp_s,
        "temperature": np.nan if frame.temperature_c is None else frame.temperature_c,
        "exposure": 1e3 * frame.exposure_gain,
        "disparity_fraction": np.mod(view.K[0, 0] * baseline_m / depth, 1.0),
        "edge_distance": distance_transform_edt(~edge) if edge.any() else float(max(z.shape)),
    }
    return {name: np.broadcast_to(np.asarray(value, dtype=np.float32), view.shape) for name, value in maps.items()}


class BlockBootstrap:
    """Holds bootstrap weights of groups of blocks, Poisson(1), float32 [draws][groups]. All statistics share them."""

    def __init__(self, groups: int, seed: int, draws: int = 4000) -> None:
        rng = np.random.Generator(np.random.Philox(seed))
        self.weights = rng.poisson(1.0, (draws, groups)).astype(np.float32)

    def ratios(self, numerators: Sequence[np.ndarray], denominator: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Returns for each numerator (sum(numerator) / sum(denominator) over groups, [bins]; its bootstrap values
        [draws][bins]), NaN where the denominator is 0. numerators, denominator: arrays [groups][bins]."""
        columns = [np.asarray(sums, dtype=np.float32) for sums in (denominator, *numerators)]
        drawn = np.split(self.weights @ np.concatenate(columns, axis=1), len(columns), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return [(n.sum(0) / denominator.sum(0), d / drawn[0]) for n, d in zip(numerators, drawn[1:], strict=True)]


def interval(draws: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns (low, high), the bounds of the central 95 % of bootstrap values [draws][...]."""
    low, high = np.nanpercentile(draws, (2.5, 97.5), axis=0)
    return low, high


def max_t(value: np.ndarray, draws: np.ndarray) -> tuple[float, np.ndarray]:
    """Computes the max-t test that all values [bins] are 0. Returns (the largest |value / standard error|; the same of
    each bootstrap sample under this hypothesis, [draws]). draws: bootstrap values, [draws][bins]."""
    deviation = np.nanstd(draws, axis=0)
    usable = np.isfinite(value) & np.isfinite(draws).all(axis=0) & (deviation > 0)
    if not usable.any():
        return 0.0, np.zeros(len(draws))
    value, draws, deviation = value[usable], draws[:, usable], deviation[usable]
    return float(np.max(np.abs(value) / deviation)), np.max(np.abs(draws - value) / deviation, axis=1)


def benjamini_yekutieli(p_values: Sequence[float] | np.ndarray) -> np.ndarray:
    """Returns the tests' q-values: rejecting q <= alpha keeps the false discovery rate below alpha, however the tests
    depend on each other."""
    p = np.asarray(p_values, dtype=np.float64)
    if p.size == 0:
        return p
    order = np.argsort(p)
    ranks = np.arange(1, p.size + 1)
    scaled = p[order] * p.size * (1.0 / ranks).sum() / ranks
    q = np.empty_like(p)
    q[order] = np.minimum(1.0, np.minimum.accumulate(scaled[::-1])[::-1])
    return q


BLOCK_PX = 16
GROUPS = 512
BINS = 20
_MOST_PIXELS = 1_200_000
# Disparity errors are clipped to this many pixels, because a mismatch may be of any size.
LARGEST_DISPARITY_ERROR_PX = 2.0
FALSE_DISCOVERY_RATE = 0.05
# An excess below this share of the floor's variance may be the renderer's Monte Carlo noise and is not analysed.
_SMALLEST_EXCESS = 0.05
# A significant effect may be small: a finding must also concentrate at least this share of the explainable error.
SMALLEST_SHARE = 0.05


@dataclass(frozen=True)
class ResidualImage:
    """Holds one image's residual, floor (expected squared residual of a perfect model) and mask of pixels that count,
    each [height][width]. maps: {covariate: [height][width]}. pose: equal for repeats, whose blocks are resampled
    together."""

    residual: np.ndarray
    floor: np.ndarray
    mask: np.ndarray
    maps: dict[str, np.ndarray]
    pose: bytes


@dataclass(frozen=True)
class Bins:
    """The bins of a covariate. code: each pixel's bin, 1..count, 0 = not defined. low, high [count]: ends of each bin's
    interval (low, high]; they are equal if each bin holds a single value."""

    code: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @property
    def count(self) -> int:
        return len(self.low)


@dataclass(frozen=True)
class Samples:
    """Pixels [n] of one channel: residual in `unit`, excess (squared residual above the floor), floor, and group of
    blocks for the bootstrap; bins: {covariate: Bins}."""

    unit: str
    residual: np.ndarray
    excess: np.ndarray
    floor: np.ndarray
    group: np.ndarray
    bins: dict[str, Bins]

    @property
    def is_explainable(self) -> bool:
        """Returns whether the excess is large enough to be analysed, see _SMALLEST_EXCESS."""
        return bool(self.excess.sum() > _SMALLEST_EXCESS * self.floor.sum())

    def group_sums(self, values: np.ndarray, code: np.ndarray | None = None, count: int = 0) -> np.ndarray:
        """Returns the sum of `values` [n] over each bootstrap group, [groups][1]. With `code`, the bin 0..count of each
        pixel, it returns sums by group and bin 1..count, [groups][count]: bin 0 counts nowhere."""
        if code is None:
            return np.bincount(self.group, values, GROUPS)[:, None]
        sums = np.bincount(self.group * (count + 1) + code, values, GROUPS * (count + 1))
        return sums.reshape(GROUPS, count + 1)[:, 1:]


def gather_samples(images: Sequence[ResidualImage], unit: str, seed: int) -> Samples | None:
    """Collects the Samples of ResidualImages, a random subset if there are very many pixels; None without any pixel."""
    rng = np.random.Generator(np.random.Philox(seed))
    total = sum(int(image.mask.sum()) for image in images)
    if total == 0:
        return None
    share = min(1.0, _MOST_PIXELS / total)
    keep = [i.mask if share == 1.0 else i.mask & (rng.random(i.mask.shape) < share) for i in images]

    def pick(name: str) -> np.ndarray:
        return np.concatenate([getattr(i, name)[k] for i, k in zip(images, keep, strict=True)]).astype(np.float64)

    residual, floor = pick("residual"), pick("floor")
    bins = {}
    for covariate in COVARIATES:
        values = np.concatenate([i.maps[covariate.name][k] for i, k in zip(images, keep, strict=True)])
        found = _bin_values(values, covariate.is_category)
        if found.count > 1:
            bins[covariate.name] = found
    # Blocks get random groups; repeats of one pose and camera share them.
    first, firsts, parts = 0, {}, []
    for image, kept in zip(images, keep, strict=True):
        block = block_numbers(kept.shape, BLOCK_PX)
        if image.pose not in firsts:
            firsts[image.pose] = first
            first += int(block[-1, -1]) + 1
        parts.append((firsts[image.pose] + block)[kept])
    group = (rng.permutation(first) % GROUPS)[np.concatenate(parts)]
    return Samples(unit, residual, residual**2 - floor, floor, group, bins)


def _bin_values(values: np.ndarray, is_category: bool) -> Bins:
    """Returns a bin for each value if there are few distinct ones, else 20 bins of equal pixel counts with rounded
    edges."""
    finite = np.isfinite(values)
    some = values[finite]
    distinct = np.unique(some[:: max(1, some.size // 100_000)]) if not is_category else np.unique(some)
    if is_category or len(distinct) <= BINS and np.isin(some, distinct).all():
        code = np.searchsorted(distinct, values) + 1
        code = np.where(finite, np.minimum(code, len(distinct)), 0)
        return Bins(code, distinct, distinct)
    edges = np.quantile(some, np.linspace(0.0, 1.0, BINS + 1))
    fine = (edges[-2] - edges[1]) / 50.0
    power = 10.0 ** np.floor(np.log10(fine)) if fine > 0 else 1.0
    step = float(max(m * power for m in (1, 2, 5) if m * power <= max(fine, power)))  # the largest round one
    inner = np.unique(np.round(edges[1:-1] / step) * step)
    inner = inner[(inner > edges[0]) & (inner < edges[-1])]
    filled = np.bincount(np.searchsorted(inner, some, side="left"), minlength=len(inner) + 1) > 0
    inner = inner[filled[:-1]]  # an empty bin is joined with the next
    code = np.searchsorted(inner, values, side="left") + 1
    ends = np.concatenate([edges[:1], inner, edges[-1:]])
    return Bins(np.where(finite, code, 0), ends[:-1], ends[1:])


def where_tables(
    channels: Mapping[str, Samples], seed: int, name_of: Callable[[Any], str] = str
) -> list[dict[str, Any]]:
    """Returns the `where` list of compare.json: a table per channel and covariate, findings first, larger first.
    channels: {name: Samples}. name_of(material id): its name."""
    bootstrap = BlockBootstrap(GROUPS, seed)
    tables: list[dict[str, Any]] = [
        {"channel": channel, "unit": samples.unit} | _table(samples, covariate, bootstrap, name_of)
        for channel, samples in channels.items()
        for covariate in COVARIATES
        if covariate.name in samples.bins
    ]
    for table, q in zip(tables, benjamini_yekutieli([t["p_value"] for t in tables]), strict=True):
        table["q_value"] = float(q)
        table["is_finding"] = bool(q <= FALSE_DISCOVERY_RATE and (table["concentration"] or 0.0) >= SMALLEST_SHARE)
    order = list(channels)
    return sorted(tables, key=lambda t: (order.index(t["channel"]), not t["is_finding"], -(t["concentration"] or 0.0)))


def _table(
    samples: Samples, covariate: Covariate, bootstrap: BlockBootstrap, name_of: Callable[[Any], str]
) -> dict[str, Any]:
    bins = samples.bins[covariate.name]
    ones = np.ones_like(samples.residual)
    sums = lambda values: samples.group_sums(values, bins.code, bins.count)  # noqa: E731
    pixels = sums(ones)
    values = (samples.residual, samples.excess)
    (mean, mean_draws), (excess, excess_draws) = columns = bootstrap.ratios([sums(v) for v in values], pixels)
    overall = bootstrap.ratios([samples.group_sums(v) for v in values], samples.group_sums(ones))
    # p value of the hypothesis that the covariate does not matter: that every bin has the overall mean and excess.
    observed, drawn = 0.0, np.zeros(1)
    for (value, draws), (all_value, all_draws) in zip(columns, overall, strict=True):
        largest, t_draws = max_t(value - all_value, draws - all_draws)
        observed, drawn = max(observed, largest), np.maximum(drawn, t_draws)
    count = pixels.sum(0)
    floor = sums(samples.floor).sum(0) / np.maximum(count, 1)
    share = count / count.sum()
    total = np.nansum(share * excess)
    concentration = mean_share = None
    if samples.is_explainable and total > 0:  # pixels without this covariate may hold all of it
        concentration = float(np.nansum(np.maximum(share * excess / total - share, 0.0)))
        mean_share = float(np.nansum(share * np.maximum(mean**2 - np.nanvar(mean_draws, axis=0), 0.0)) / total)
    mean_low, mean_high = interval(mean_draws)
    excess_low, excess_high = interval(excess_draws)
    rows = []
    for i in np.flatnonzero(count):
        place: dict[str, Any] = {"low": float(bins.low[i]), "high": float(bins.high[i])}
        if covariate.is_category:
            place = {"label": name_of(int(bins.low[i]))}
        rows.append(
            place
            | {
                "pixels": int(count[i]),
                "mean": float(mean[i]),
                "mean_interval": [float(mean_low[i]), float(mean_high[i])],
                "rmse": float(np.sqrt(max(0.0, excess[i] + floor[i]))),
                "noise_floor": float(np.sqrt(max(0.0, floor[i]))),
                "excess": float(excess[i]),
                "excess_interval": [float(excess_low[i]), float(excess_high[i])],
            }
        )
    return {
        "covariate": covariate.name,
        "covariate_unit": covariate.unit,
        "concentration": concentration,
        "mean_share": mean_share,
        "p_value": float((1 + np.count_nonzero(drawn >= observed)) / (1 + np.size(drawn))),
        "bins": rows,
    }
