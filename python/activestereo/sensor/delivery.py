# SPDX-License-Identifier: Apache-2.0
"""Simulates the transport of frames from camera to program: delays and losses, for each environment separately.

delivery = Delivery(environments=E, latency_ms=33.0, jitter_ms=5.0, drop_share=0.02, seed=0)
delivery.put(batch.get_depth(), time_s)  # when a frame is taken
depth_m, taken_s = delivery.get(time_s)  # at each step of the policy
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from activestereo.common.limits import Limits

_LATENCY, _SHARE = Limits(0.0, 1e6, "ms"), Limits(0.0, 1.0)
_ENVIRONMENTS, _SEED = Limits(1, 1_000_000, whole=True), Limits(0, 2**64 - 1, whole=True)


class Delivery:
    """Holds frames back for a random delay and drops some of them. The same seed repeats delays and losses.

    latency_ms: mean time from the middle of the exposure to the arrival, a number or [E]. jitter_ms: its standard
    deviation, likewise. No frame arrives before it was taken, and none overtakes another. drop_share: share of frames
    that never arrive. Raises ValueError for values out of range."""

    def __init__(
        self, environments: int, latency_ms: ArrayLike = 0.0, jitter_ms: ArrayLike = 0.0, drop_share: ArrayLike = 0.0,
        seed: int = 0,
    ) -> None:  # fmt: skip
        self._count = int(_ENVIRONMENTS.check("environments", environments))
        self._latency_s = 1e-3 * _LATENCY.check_each("latency_ms", latency_ms, self._count)
        self._jitter_s = 1e-3 * _LATENCY.check_each("jitter_ms", jitter_ms, self._count)
        self._drop_share = _SHARE.check_each("drop_share", drop_share, self._count)
        self.restart(seed)

    def restart(self, seed: int) -> None:
        """Forgets all frames, delivered or on their way, and restarts the random draws under this seed."""
        self._random = np.random.default_rng(int(_SEED.check("the seed", seed)))
        self._under_way: deque[tuple[Any, float, NDArray[np.float64]]] = deque()
        self._last_s = np.full(self._count, -np.inf)  # when each environment's last frame arrives
        self._taken_s = np.full(self._count, np.nan)
        self._arrived: Any = None

    def put(self, images: Any, time_s: float) -> None:
        """Sends a copy of images [E, ...], NumPy or torch, that were taken at time_s, and draws their delays and
        losses."""
        if len(images) != self._count:
            raise ValueError(f"images are of {len(images)} environments, expected {self._count}")
        late_s = self._latency_s + self._jitter_s * self._random.standard_normal(self._count)
        arrives_s = np.maximum(time_s + np.maximum(late_s, 0.0), self._last_s)
        is_dropped = self._random.random(self._count) < self._drop_share
        self._last_s = np.where(is_dropped, self._last_s, arrives_s)
        copy = images.clone() if hasattr(images, "clone") else np.array(images)
        self._under_way.append((copy, time_s, np.where(is_dropped, np.inf, arrives_s)))

    def get(self, time_s: float) -> tuple[Any, NDArray[np.float64]]:
        """Returns the newest images [E, ...] that have arrived by time_s, and when each was taken, [E] seconds. An
        environment without a frame has 0 and NaN. Raises RuntimeError before the first put()."""
        if self._arrived is None:
            if not self._under_way:
                raise RuntimeError("no image was put in yet")
            self._arrived = self._under_way[0][0] * 0
        for images, taken_s, arrives_s in self._under_way:
            rows = np.flatnonzero(arrives_s <= time_s).tolist()
            self._arrived[rows] = images[rows]
            self._taken_s[rows] = taken_s
            arrives_s[rows] = np.inf
        while self._under_way and np.isinf(self._under_way[0][2]).all():
            self._under_way.popleft()
        return self._arrived, self._taken_s.copy()
