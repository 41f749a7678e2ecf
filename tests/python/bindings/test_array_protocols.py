# SPDX-License-Identifier: Apache-2.0
"""Arrays cross between the libraries, NumPy and whoever speaks DLPack: each is the same memory, never a copy."""

import gc
import re
import subprocess
import sys
import weakref
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import kuafu
import simsense

FORMATS = ["uint8", "uint16", "int16", "uint32", "float16", "float32"]
MODULES = [kuafu, simsense]


@pytest.fixture(params=MODULES, ids=lambda module: module.__name__)
def module(request: pytest.FixtureRequest) -> ModuleType:
    return request.param


@pytest.fixture
def own_device(module: ModuleType) -> Any:
    return module.Device("cpu")


@pytest.fixture
def buffer(module: ModuleType, own_device: Any) -> Any:
    return module.Buffer(own_device, 4096)


def read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


@pytest.mark.parametrize("dtype", FORMATS)
def test_numpy_sees_an_images_memory_by_each_protocol(buffer: Any, dtype: str) -> None:
    image = buffer.image(dtype, (2, 3, 5), 64)
    plain = image.array()
    plain[:] = np.arange(30).reshape(2, 3, 5)
    for seen in (np.asarray(image), np.from_dlpack(image)):
        assert seen.ctypes.data == plain.ctypes.data and seen.dtype == plain.dtype and seen.shape == (2, 3, 5)
        plain[1, 2, 4] = 77
        assert seen[1, 2, 4] == 77
        plain[1, 2, 4] = 29
        if seen.flags.writeable:  # NumPy before 2.1 shows what comes by DLPack read-only
            seen[0, 0, 0] = 78
            assert plain[0, 0, 0] == 78
            plain[0, 0, 0] = 0
    assert np.asarray(image).flags.writeable
    assert image.__dlpack_device__() == (1, 0)
    assert image.__array_interface__["version"] == 3


def test_a_buffer_is_its_bytes(buffer: Any) -> None:
    np.asarray(buffer)[:4] = (1, 2, 3, 4)
    for seen in (np.from_dlpack(buffer), np.asarray(buffer), np.asarray(memoryview(buffer))):
        assert seen.dtype == np.uint8 and seen.shape == (4096,) and list(seen[:4]) == [1, 2, 3, 4]
    assert buffer.__array_interface__["data"][0] == np.asarray(buffer).ctypes.data


def test_what_is_shared_outlives_its_names(module: ModuleType, own_device: Any) -> None:
    buffer = module.Buffer(own_device, 4096)
    image = buffer.image("float32", (4, 4))
    views = [np.asarray(image), np.from_dlpack(image), np.from_dlpack(buffer)]
    views[0][:] = 5
    del buffer, image
    gc.collect()
    assert (views[1] == 5).all() and views[2][3] == 64


def test_the_host_s_memory_has_no_stream(buffer: Any) -> None:
    with pytest.raises((RuntimeError, BufferError), match="stream"):
        buffer.image("uint8", (4,)).__dlpack__(stream=1)


@pytest.mark.parametrize("dtype", FORMATS)
def test_an_array_of_another_library_becomes_an_image(module: ModuleType, own_device: Any, dtype: str) -> None:
    array = np.zeros((16, 64), dtype)
    image = module.Image.from_dlpack(own_device, array)
    assert image.shape == (16, 64) and image.dtype == array.dtype
    assert image.array().ctypes.data == array.ctypes.data
    image.array()[3, 5] = 9
    assert array[3, 5] == 9
    array[3, 6] = 10
    assert image.array()[3, 6] == 10


def test_strides_cross(own_device: Any, module: ModuleType) -> None:
    whole = np.arange(32 * 64, dtype=np.float32).reshape(32, 64)
    for view in (whole[::2, 16:48], whole[::-1], whole.T):
        image = module.Image.from_dlpack(own_device, view)
        np.testing.assert_array_equal(image.array(), view)
        assert image.array().strides == view.strides


def test_the_producer_lives_as_long_as_the_image(module: ModuleType, own_device: Any) -> None:
    class Array(np.ndarray):
        """One that can be watched."""

    array = np.zeros((8, 8), np.float32).view(Array)
    watched = weakref.ref(array)
    image = module.Image.from_dlpack(own_device, array)
    del array
    gc.collect()
    assert watched() is not None
    del image
    gc.collect()
    assert watched() is None


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: np.zeros((4, 4)), "no image can hold float64"),
        (lambda: np.zeros((0, 4), np.uint8), "empty"),
        (lambda: np.zeros((1,) * 6, np.uint8), "6 dimensions"),
        (lambda: read_only(np.zeros(64, np.uint8)), "read-?only"),
        (lambda: [1, 2, 3], "__dlpack__"),
    ],
)
def test_what_cannot_be_taken_is_one_error(
    module: ModuleType, own_device: Any, make: Callable[[], Any], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        module.Image.from_dlpack(own_device, make())


def test_simsense_computes_on_an_array_of_another_library() -> None:
    device = simsense.Device("host")
    k = [[40, 0, 19.5], [0, 40, 15.5], [0, 0, 1]]
    camera = simsense.Camera(40, 32, k)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    engine = simsense.Engine(device, camera, camera, left_to_right, rectified=True, max_disparity=16)
    pair = np.random.default_rng(1).integers(0, 255, (2, 32, 40), dtype=np.uint8)
    depth = np.full((32, 40), -1, np.float32)
    images = [simsense.Image.from_dlpack(device, array) for array in (pair[0], pair[1], depth)]
    engine.compute(images[0], images[1], {"depth": images[2]})
    np.testing.assert_array_equal(depth, engine.compute(pair[0], pair[1])["depth"])


def test_a_view_at_the_interpreters_end_is_let_go() -> None:
    program = "import kuafu, numpy; keep = numpy.from_dlpack(kuafu.Buffer(kuafu.Device('cpu'), 64)); print('fine')"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (said.returncode, said.stdout, said.stderr) == (0, "fine\n", "")


@pytest.mark.parametrize("module", ["kuafu", "simsense"])
def test_a_build_that_misreads_numpy_2_says_so(module) -> None:
    """pybind11 before 2.12 takes NumPy 2's types for empty ones. PyPI's wheels are built by a newer one."""
    header = Path("/usr/include/pybind11/detail/common.h")
    if (
        "site-packages" in kuafu.__file__
        or not header.exists()
        or int(re.search(r"VERSION_MINOR (\d+)", header.read_text())[1]) >= 12
    ):
        pytest.skip("this build's pybind11 knows NumPy 2")
    line = f"import numpy; numpy.__version__ = '2.1.0'; import {module}"
    run = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "2.1.0 is installed: pip install 'numpy<2'" in run.stderr
