# SPDX-License-Identifier: Apache-2.0
"""Processes that share work end with the one that started them, however that ends."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

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
    from activestereo.common.processes import process_pool

    with pytest.raises(ZeroDivisionError), process_pool(1, os.getpid, method="fork") as pool:
        workers = {pool.submit(os.getpid).result()}
        raise ZeroDivisionError
    assert not any(is_running(number) for number in workers)
