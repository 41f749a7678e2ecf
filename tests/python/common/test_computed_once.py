# SPDX-License-Identifier: Apache-2.0
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from activestereo.common.computed_once import computed_once


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


def test_threads_share_one_computation():
    images = Images()
    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(lambda _: images.rendered(), range(32)))
    assert images.made == 1
    assert all(result is results[0] for result in results)


def test_each_object_has_its_own_result():
    first, second = Images(), Images()
    assert first.rendered() is not second.rendered()


def test_an_error_is_not_kept():
    images = Images()
    with pytest.raises(OSError, match="disk"):
        images.failing()
    assert images.failing() == 2
