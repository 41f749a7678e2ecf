# SPDX-License-Identifier: Apache-2.0
import pickle
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


def test_an_object_with_results_can_be_pickled():
    images = Images()
    images.rendered()
    copy = pickle.loads(pickle.dumps({key: value for key, value in vars(images).items() if key != "begun"}))
    assert copy["_rendered_computed"] == [1]
