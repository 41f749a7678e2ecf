# SPDX-License-Identifier: Apache-2.0
"""Counter-based random streams by seed and name, so that every part that asks gets the same numbers."""

import hashlib

import numpy as np


def random_stream(seed: int, name: str, salt: bytes = b"") -> np.random.Generator:
    """A numpy Generator of its own for each seed, name and salt."""
    digest = hashlib.sha256(f"{seed} {name} ".encode() + salt).digest()
    return np.random.Generator(np.random.Philox(key=np.frombuffer(digest[:16], dtype=np.uint64)))
