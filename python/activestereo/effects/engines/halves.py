# SPDX-License-Identifier: Apache-2.0
"""Two independent halves of a render's samples: what they differ by is the renderer's own noise."""

HALVES = (0, 1)
# The second half's random numbers have nothing in common with any first half's of a seed below this.
_SEEDS_APART = 1 << 32


def half_samples(samples_per_pixel: int) -> int:
    """Samples per pixel of each half."""
    return max(1, (samples_per_pixel + 1) // 2)


def half_seeds(seed: int) -> tuple[int, int]:
    """The seeds of both halves."""
    return seed, seed + _SEEDS_APART
