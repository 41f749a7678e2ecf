# SPDX-License-Identifier: Apache-2.0
"""Finds regions of the covariates that hold most of the explainable error, by a shallow honest regression tree, and
names them in words.

Half A of the blocks chooses the splits and half B estimates all figures, so the search does not bias them (Athey and
Imbens, PNAS 113, 2016). A split that half B does not confirm is undone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from activestereo.compare.where import COVARIATES, GROUPS, BlockBootstrap, Samples, interval

DEPTH = 3
_SMALLEST_LEAF = 0.01
_ORDER = {covariate.name: covariate for covariate in COVARIATES}


@dataclass
class _Node:
    """A node of the tree: one region of the covariates. a, b: indices of its pixels in the halves A and B. conditions:
    {covariate: codes of the bins that belong to the region}."""

    a: np.ndarray
    b: np.ndarray
    conditions: dict[str, set[int]]
    children: list[_Node] = field(default_factory=list)

    def leaves(self) -> list[Any]:
        return [leaf for child in self.children for leaf in child.leaves()] or [self]

    def below(self) -> list[Any]:
        return [node for child in self.children for node in (child, *child.below())]


class HonestTree:
    """A regression tree of the excess error over the covariates. Half A of the pixel blocks chooses the splits; half B
    prunes them and estimates all figures."""

    def __init__(self, samples: Samples, seed: int) -> None:
        self._samples = samples
        half = samples.group % 2 == 0
        a, b = np.flatnonzero(half), np.flatnonzero(~half)
        self._smallest = max(1, int(_SMALLEST_LEAF * len(a)))
        self._bootstrap = BlockBootstrap(GROUPS, seed, draws=1000)
        # The search alone divides by the noise floor; otherwise a few bright, noisy pixels would choose every split.
        floor = np.maximum(samples.floor, 0.25 * samples.floor.mean() if samples.floor.any() else 1.0)
        self._target = samples.excess / floor
        self._root = _Node(a, b, {})
        self._grow(self._root, DEPTH)

    def regions(self, name_of: Callable[[Any], str] = str) -> dict[str, Any]:
        """Returns {leaves, headline}. Each region is {words, conditions, share, share_interval, pixel_share, excess}.
        leaves: sorted by share of the excess, largest first; headline: the node, of any depth, whose share of the
        excess most exceeds its share of pixels. name_of: names a category's value."""
        leaves = [self._region(leaf, name_of) for leaf in self._root.leaves()]
        inner = [self._region(node, name_of) for node in self._root.below()]
        headline = max(inner, key=lambda r: r["share"] - r["pixel_share"], default=None)
        return {"leaves": sorted(leaves, key=lambda r: -r["share"]), "headline": headline}

    def _region(self, node: Any, name_of: Any) -> dict[str, Any]:
        excess = self._sums(node, self._samples.excess)[:, None]
        [(share, draws)] = self._bootstrap.ratios([excess], self._sums(self._root, self._samples.excess)[:, None])
        low, high = interval(draws)
        conditions = [self._condition(name, codes, name_of) for name, codes in node.conditions.items()]
        return {
            "words": " and ".join(c.pop("words") for c in conditions) or "everywhere",
            "conditions": conditions,
            "share": float(share[0]),
            "share_interval": [float(low[0]), float(high[0])],
            "pixel_share": len(node.b) / len(self._root.b),
            "excess": float(excess.sum() / max(len(node.b), 1)),
        }

    def _sums(self, node: Any, values: np.ndarray) -> np.ndarray:
        return np.bincount(self._samples.group[node.b], values[node.b], GROUPS)

    def _grow(self, node: Any, depth: int) -> None:
        best = self._best_split(node) if depth else None
        if best is None:
            return
        name, codes, rest = best
        code = self._samples.bins[name].code
        in_a, in_b = (np.isin(code[pixels], list(codes)) for pixels in (node.a, node.b))
        inside = _Node(node.a[in_a], node.b[in_b], node.conditions | {name: codes})
        outside = _Node(node.a[~in_a], node.b[~in_b], node.conditions | {name: rest})
        node.children = [inside, outside]
        for child in node.children:
            self._grow(child, depth - 1)
        if not any(child.children for child in node.children) and not self._is_confirmed(inside, outside):
            node.children = []

    def _best_split(self, node: Any) -> Any:
        """Returns (covariate, bin codes of one side, bin codes of the other) of the split of half A that most reduces
        the squared deviation; None if none does."""
        target = self._target[node.a]
        total = target.sum()
        best_gain, best = total**2 / max(len(target), 1), None
        for name, bins in self._samples.bins.items():
            code = bins.code[node.a]
            pixels = np.bincount(code, minlength=bins.count + 1)
            sums = np.bincount(code, target, bins.count + 1)
            order = np.arange(bins.count + 1)
            if _ORDER[name].is_category:
                order = np.argsort(sums / np.maximum(pixels, 1))
            n, s = np.cumsum(pixels[order])[:-1], np.cumsum(sums[order])[:-1]
            m = len(target) - n
            allowed = (n >= self._smallest) & (m >= self._smallest)
            if not allowed.any():
                continue
            gain = np.where(allowed, s**2 / np.maximum(n, 1) + (total - s) ** 2 / np.maximum(m, 1), 0.0)
            at = int(np.argmax(gain))
            if gain[at] > best_gain:
                known = node.conditions.get(name, set(range(bins.count + 1)))
                low = {int(c) for c in order[: at + 1]} & known
                best_gain, best = gain[at], (name, known - low, low)
        return best

    def _is_confirmed(self, inside: Any, outside: Any) -> bool:
        """Returns whether the excess per pixel of half B differs between two regions: the 95 % interval of the
        difference leaves out 0."""
        if not len(inside.b) or not len(outside.b):
            return False
        means = []
        for node in (inside, outside):
            ones = np.bincount(self._samples.group[node.b], minlength=GROUPS)[:, None]
            [(_, draws)] = self._bootstrap.ratios([self._sums(node, self._samples.excess)[:, None]], ones)
            means.append(draws[:, 0])
        low, high = interval(means[0] - means[1])
        return bool(low > 0 or high < 0)

    def _condition(self, name: str, codes: Any, name_of: Any) -> dict[str, Any]:
        covariate, bins = _ORDER[name], self._samples.bins[name]
        codes = sorted(c for c in codes if c > 0)
        if not codes:
            return {"covariate": name, "values": [], "words": f"no {covariate.words}"}
        if bins.values is not None and covariate.is_category:
            names = [name_of(int(bins.values[c - 1])) for c in codes]
            said = names[0] if len(names) == 1 else ", ".join(names[:-1]) + " or " + names[-1]
            return {"covariate": name, "values": names, "words": f"{covariate.words} is {said}"}
        edges = bins.edges
        if edges is None:  # between single values the middle is the limit
            v = np.asarray(bins.values)
            edges = np.concatenate([v[:1], (v[1:] + v[:-1]) / 2, v[-1:]])
        low = None if codes[0] == 1 else float(edges[codes[0] - 1])
        high = None if codes[-1] == bins.count else float(edges[codes[-1]])
        unit = f" {covariate.unit}" if covariate.unit and covariate.name != "radius" else ""
        if low is None:
            words = f"any {covariate.words}" if high is None else f"{covariate.words} ≤ {high:.4g}{unit}"
        elif high is None:
            words = f"{covariate.words} > {low:.4g}{unit}"
        else:
            words = f"{low:.4g} < {covariate.words} ≤ {high:.4g}{unit}"
        return {"covariate": name, "low": low, "high": high, "words": words}
