# SPDX-License-Identifier: Apache-2.0
"""Arrays cross between the libraries, NumPy and whoever speaks DLPack: each is the same memory, never a copy."""

import ctypes as c
import gc
import subprocess
import sys
import weakref
from collections.abc import Callable
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


class Tensor(c.Structure):
    """DLTensor of the DLPack specification."""

    _fields_ = [
        ("data", c.c_void_p), ("device", c.c_int32 * 2), ("ndim", c.c_int32), ("code", c.c_uint8),
        ("bits", c.c_uint8), ("lanes", c.c_uint16), ("shape", c.POINTER(c.c_int64)),
        ("strides", c.POINTER(c.c_int64)), ("byte_offset", c.c_uint64),
    ]  # fmt: skip


Deleter = c.CFUNCTYPE(None, c.c_void_p)


class Versioned(c.Structure):
    _fields_ = [
        ("major", c.c_uint32), ("minor", c.c_uint32), ("context", c.c_void_p), ("deleter", Deleter),
        ("flags", c.c_uint64), ("tensor", Tensor),
    ]  # fmt: skip


c.pythonapi.PyCapsule_GetPointer.restype, c.pythonapi.PyCapsule_GetPointer.argtypes = (
    c.c_void_p,
    [c.py_object, c.c_char_p],
)
c.pythonapi.PyCapsule_New.restype, c.pythonapi.PyCapsule_New.argtypes = (
    c.py_object,
    [c.c_void_p, c.c_char_p, c.c_void_p],
)
c.pythonapi.PyCapsule_IsValid.argtypes = [c.py_object, c.c_char_p]


class Producer:
    """Another library: a versioned tensor over a NumPy array, which counts how often it was deleted."""

    def __init__(self, array: np.ndarray, *, major: int = 1, flags: int = 0, device_type: int = 1) -> None:
        self.array, self.deleted = array, 0
        kind = {"u": 1, "i": 0, "f": 2}[array.dtype.kind]
        self._shape = (c.c_int64 * array.ndim)(*array.shape)
        self._strides = (c.c_int64 * array.ndim)(*(s // array.itemsize for s in array.strides))
        tensor = Tensor(
            array.ctypes.data, (c.c_int32 * 2)(device_type, 0), array.ndim, kind, 8 * array.itemsize, 1,
            self._shape, self._strides, 0,
        )  # fmt: skip
        self._deleter = Deleter(self._delete)
        self._managed = Versioned(major, 0, None, self._deleter, flags, tensor)

    def _delete(self, _: int) -> None:
        self.deleted += 1

    def __dlpack__(self, *, max_version: tuple[int, int] | None = None) -> Any:
        assert max_version is not None and max_version >= (1, 0)
        return c.pythonapi.PyCapsule_New(c.addressof(self._managed), b"dltensor_versioned", None)


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


def test_the_consumer_chooses_the_version(buffer: Any) -> None:
    image = buffer.image("int16", (6, 2))
    for version in (None, (0, 8)):
        assert c.pythonapi.PyCapsule_IsValid(image.__dlpack__(max_version=version), b"dltensor")
    capsule = image.__dlpack__(max_version=(1, 2), dl_device=(1, 0), copy=None)
    at = c.pythonapi.PyCapsule_GetPointer(capsule, b"dltensor_versioned")
    managed = Versioned.from_address(at)
    tensor = managed.tensor
    assert (managed.major, managed.minor, managed.flags) == (1, 0, 0)
    assert tensor.data == image.array().ctypes.data and list(tensor.device) == [1, 0]
    assert (tensor.code, tensor.bits, tensor.lanes, tensor.ndim) == (0, 16, 1, 2)
    assert tensor.shape[:2] == [6, 2] and tensor.strides[:2] == [2, 1]


def test_what_cannot_be_given_is_an_error(module: ModuleType, own_device: Any, buffer: Any) -> None:
    image = buffer.image("uint8", (4,))
    with pytest.raises(BufferError, match="copies none"):
        image.__dlpack__(copy=True)
    with pytest.raises(BufferError, match="on the host"):
        image.__dlpack__(dl_device=(2, 0))
    with pytest.raises(ValueError, match="stream"):
        image.__dlpack__(stream=1)


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


def test_versioned_tensors_are_taken_and_let_go_once(module: ModuleType, own_device: Any) -> None:
    producer = Producer(np.arange(64, dtype=np.uint16).reshape(8, 8))
    image = module.Image.from_dlpack(own_device, producer)
    np.testing.assert_array_equal(image.array(), producer.array)
    view = image.array()
    del image
    gc.collect()
    assert producer.deleted == 0, "the view is alive"
    del view
    gc.collect()
    assert producer.deleted == 1


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
        (lambda: np.zeros((4, 4)), "64 bits"),
        (lambda: np.zeros((4, 4), np.complex64), "fit no image"),
        (lambda: np.zeros((0, 4), np.uint8), "empty"),
        (lambda: np.zeros((1,) * 6, np.uint8), "6 dimensions"),
        (lambda: Producer(np.zeros(64, np.uint8), major=2), "version 2"),
        (lambda: Producer(np.zeros(64, np.uint8), flags=1), "read-only"),
        (lambda: Producer(np.zeros(64, np.uint8), device_type=2), "on a device"),
        (lambda: [1, 2, 3], "no __dlpack__"),
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
