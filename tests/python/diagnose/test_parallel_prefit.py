# SPDX-License-Identifier: Apache-2.0
"""Fits made ahead in forked processes: what they find is there afterwards, and what fails is left to the caller."""

import os
import signal
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from activestereo.compare.cache import LayerCache
from activestereo.diagnose.refine.parallel_prefit import parallel_prefit
from activestereo.diagnose.refine.fit_cache import FitCache, NotKnown


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
    squares, done = Squares(memory), list[int]()
    parallel_prefit(memory, squares, [3, 4, 5], 2, done.append)
    assert sorted(done) == [0, 1, 2] and squares.made == 0
    assert [memory.by_known(lambda n=n: squares(n)) for n in (3, 4, 5)] == [9.0, 16.0, 25.0]
    with pytest.raises(NotKnown):
        memory.by_known(lambda: squares(6))
    assert squares(6) == 36.0 and squares.made == 1, "it fits again after by_known()"


def test_one_worker_leaves_all_to_the_caller(memory: FitCache) -> None:
    parallel_prefit(memory, Squares(memory), [3, 4], 1, lambda i: pytest.fail("nothing is to be done ahead"))
    assert len(memory) == 0


def test_what_fails_or_dies_in_a_process_is_left_to_the_caller(memory: FitCache) -> None:
    squares, done = Squares(memory), list[int]()

    def failing(n: int) -> float:
        if n == 4:
            raise ValueError("four")
        return squares(n)

    parallel_prefit(memory, failing, [3, 4, 5], 2, done.append)
    assert sorted(done) == [0, 2] and len(memory) == 2

    def dying(n: int) -> float:
        if n == 7 and os.getpid() != squares.own:
            os._exit(1)
        return squares(n)

    parallel_prefit(memory, dying, [7, 7, 7], 2, done.append)
    assert sorted(done) == [0, 2] and squares(7) == 49.0


def test_a_cancellation_ends_the_call(memory: FitCache) -> None:
    def cancel(i: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        parallel_prefit(memory, Squares(memory), list(range(8)), 2, cancel)
    parallel_prefit(memory, Squares(memory), [20, 21], 2, lambda i: None)
    assert memory.by_known(lambda: Squares(memory)(21)) == 441.0, "another call works"


@pytest.mark.parametrize("kills", [1, 2])
def test_a_killed_process_is_replaced_by_another(memory: FitCache, tmp_path: Path, kills: int) -> None:
    squares, done = Squares(memory), list[int]()

    def killed_at_first(n: int) -> float:
        for k in range(kills):
            with suppress(FileExistsError):
                (tmp_path / f"killed {k}").touch(exist_ok=False)
                os.kill(os.getpid(), signal.SIGKILL)
        return squares(n)

    parallel_prefit(memory, killed_at_first, list(range(6)), 2, done.append)
    assert sorted(done) == list(range(6)) and squares.made == 0, "processes make all, none is left to the caller"
