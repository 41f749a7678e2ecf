# SPDX-License-Identifier: Apache-2.0
"""Fits made ahead in forked processes: what they find is there afterwards, and what fails is left to the caller."""

import os
import signal
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from activestereo.common.processes import forked
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.kept import FitCache


@pytest.fixture
def memory(tmp_path: Path) -> FitCache:
    return FitCache(LayerCache(tmp_path), [])


class Squares:
    """work(n) asks for the fit of n; `made` counts the fits of this process."""

    def __init__(self, memory: FitCache) -> None:
        self.memory, self.made, self.own = memory, 0, os.getpid()

    def __call__(self, n: int) -> float:
        return float(self.memory.once(f"square {n}", lambda: self._made(n))["value"])

    def _made(self, n: int) -> dict[str, np.ndarray]:
        self.made += 1
        return {"value": np.array(n * n)}


def test_fits_come_back_from_their_processes(memory: FitCache) -> None:
    squares = Squares(memory)
    memory.make_ahead(squares, [3, 4, 5], 2)
    assert [squares(n) for n in (3, 4, 5)] == [9.0, 16.0, 25.0] and squares.made == 0
    assert squares(6) == 36.0 and squares.made == 1


def test_one_worker_leaves_all_to_the_caller(memory: FitCache) -> None:
    assert list(forked(Squares(memory), [3, 4], 1)) == list(forked(Squares(memory), [3], 2)) == []


def test_what_fails_or_dies_in_a_process_is_left_to_the_caller(memory: FitCache) -> None:
    squares = Squares(memory)

    def failing(n: int) -> float:
        if n == 4:
            raise ValueError("four")
        return squares(n)

    memory.make_ahead(failing, [3, 4, 5], 2)
    assert [squares(n) for n in (3, 5)] == [9.0, 25.0] and squares.made == 0

    def dying(n: int) -> float:
        if n == 7 and os.getpid() != squares.own:
            os._exit(1)
        return squares(n)

    memory.make_ahead(dying, [7, 7, 7], 2)
    assert squares(7) == 49.0 and squares.made == 1


def test_a_cancellation_ends_the_call(memory: FitCache) -> None:
    with pytest.raises(KeyboardInterrupt):
        for _ in forked(Squares(memory), list(range(8)), 2):
            raise KeyboardInterrupt
    squares = Squares(memory)
    memory.make_ahead(squares, [20, 21], 2)
    assert squares(21) == 441.0 and squares.made == 0, "another call works"


@pytest.mark.parametrize("kills", [1, 2])
def test_a_killed_process_is_replaced_by_another(memory: FitCache, tmp_path: Path, kills: int) -> None:
    squares = Squares(memory)

    def killed_at_first(n: int) -> float:
        for k in range(kills):
            with suppress(FileExistsError):
                (tmp_path / f"killed {k}").touch(exist_ok=False)
                os.kill(os.getpid(), signal.SIGKILL)
        return squares(n)

    memory.make_ahead(killed_at_first, list(range(6)), 2)
    assert [squares(n) for n in range(6)] == [float(n * n) for n in range(6)]
    assert squares.made == 0, "processes make all, none is left to the caller"
