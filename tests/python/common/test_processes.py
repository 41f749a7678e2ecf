# SPDX-License-Identifier: Apache-2.0
"""Processes that share work end with the one that started them; threads share one computation."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path

import pytest

from activestereo.common.computed_once import computed_once
from activestereo.common.processes import done_in_pools, process_pool

PARENT = """
import os, sys, time
from activestereo.common.processes import process_pool

if __name__ == "__main__":
    with process_pool(2, os.getpid, method=sys.argv[1]) as pool:
        numbers = {pool.submit(os.getpid).result() for _ in range(20)}
        print(*numbers, *pool._processes, flush=True)
        time.sleep(60)
"""


def is_running(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("method", ["spawn", "fork"])
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_no_worker_is_left_two_seconds_after_its_parent(tmp_path, method, end):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    heard = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731  # a shell's background ignores it
    quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True, "preexec_fn": heard}
    parent = subprocess.Popen([sys.executable, str(script), method], **quiet)
    workers = {int(word) for word in parent.stdout.readline().split()}
    assert workers and all(is_running(number) for number in workers)
    os.kill(parent.pid, end)
    parent.wait(timeout=60)
    deadline = time.monotonic() + 2.0
    while any(is_running(number) for number in workers) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not any(is_running(number) for number in workers)


def test_work_left_by_an_error_is_cancelled_and_its_processes_end():
    with pytest.raises(ZeroDivisionError), process_pool(1, os.getpid, method="fork") as pool:
        workers = {pool.submit(os.getpid).result()}
        raise ZeroDivisionError
    assert not any(is_running(number) for number in workers)


def killed_until(place: tuple[str, int, int]) -> int:
    """Kills its process the first so many times that an item is asked for."""
    folder, item, kills = place
    for k in range(kills):
        try:
            Path(folder, f"{item} {k}").touch(exist_ok=False)
        except FileExistsError:
            continue
        os.kill(os.getpid(), signal.SIGKILL)
    return item


@pytest.mark.parametrize(("method", "kills"), [("fork", 1), ("spawn", 1), ("fork", 2)])
def test_killed_processes_are_replaced_until_all_is_done(tmp_path, method, kills):
    items = [(str(tmp_path), item, kills if item == 3 else 0) for item in range(6)]
    pools = partial(process_pool, 2, os.getpid, method=method)
    found = {i: done.result() for i, done in done_in_pools(pools, killed_until, items)}
    assert found == {item: item for item in range(6)}


def test_items_that_always_end_their_process_fail_after_three_pools(tmp_path):
    items = [(str(tmp_path), 0, 99), (str(tmp_path), 1, 99)]
    left = dict(done_in_pools(partial(process_pool, 1, os.getpid, method="fork"), killed_until, items))
    assert sorted(left) == [0, 1] and all(isinstance(done.exception(), BrokenProcessPool) for done in left.values())
    assert len(list(tmp_path.iterdir())) == 3


class Images:
    def __init__(self) -> None:
        self.made = 0
        self.begun = threading.Event()

    @computed_once
    def rendered(self) -> list[int]:
        self.made += 1
        self.begun.wait(0.2)  # long enough for the other threads to arrive
        return [self.made]

    @computed_once
    def failing(self) -> int:
        self.made += 1
        if self.made == 1:
            raise OSError("disk")
        return self.made


def test_threads_share_one_computation_and_each_object_has_its_own():
    images = Images()
    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(lambda _: images.rendered(), range(32)))
    assert images.made == 1 and all(result is results[0] for result in results)
    copy = pickle.loads(pickle.dumps({key: value for key, value in vars(images).items() if key != "begun"}))
    assert copy["_rendered_computed"] == [1]
    assert Images().rendered() is not results[0]


def test_an_error_is_not_kept():
    images = Images()
    with pytest.raises(OSError, match="disk"):
        images.failing()
    assert images.failing() == 2


class Chained:
    def __init__(self, source=None) -> None:
        self.source, self.inside = source, threading.Event()

    @computed_once
    def images(self) -> int:
        self.inside.set()
        if self.source is None:
            threading.Event().wait(0.3)
            return 1
        return self.source.splines()

    @computed_once
    def splines(self) -> int:
        self.inside.set()
        threading.Event().wait(0.1)
        return self.images() + 1


def test_objects_do_not_wait_for_one_another():
    """One thread goes from images() to another object's splines(), another from splines() to images()."""
    with ThreadPoolExecutor(2) as pool:
        one = pool.submit(Chained(Chained()).images)
        two = pool.submit(Chained().splines)
        assert (one.result(5), two.result(5)) == (2, 2)
