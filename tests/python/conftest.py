# SPDX-License-Identifier: Apache-2.0
"""The built packages come from ACTIVESTEREO_BUILD, else from build/ beside the sources."""

import fcntl
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build")).resolve()
sys.path.insert(0, str(BUILD / "python"))


@pytest.fixture(scope="session")
def build():
    return BUILD


@pytest.fixture(scope="session")
def table_top(tmp_path_factory):
    """The example scene's file."""
    from activestereo.scene_io.example_scene import write_table_top

    path = tmp_path_factory.mktemp("scene") / "table_top.gltf"
    write_table_top(path)
    return path


@pytest.fixture(scope="session")
def device():
    import kuafu

    return kuafu.Device()


@pytest.fixture(scope="session")
def stub_cuda(tmp_path_factory):
    """The library of tests/support/stub_cuda.c, in the place of CUDA's driver (shared/cuda_stub.py)."""
    library = tmp_path_factory.mktemp("cuda") / "libcuda.so.1"
    source = ROOT / "tests/support/stub_cuda.c"
    subprocess.run(["cc", "-shared", "-fPIC", "-Wall", "-Werror", "-o", library, source], check=True)
    return library


@pytest.fixture(scope="session")
def torch_on_a_gpu():
    """PyTorch, where it has a CUDA device."""
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    if not torch.cuda.is_available():
        pytest.skip("PyTorch sees no CUDA device")
    return torch


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory):
    """One folder for all processes of this run of pytest."""
    folder = tmp_path_factory.getbasetemp()
    return folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder


def made_once(path, make):
    """The result of make(), made by the first process that asks for it."""
    with open(path.with_suffix(".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))
    return pickle.loads(path.read_bytes())


@pytest.fixture(scope="session")
def lab_world(run_folder):
    """A table-top in front of a plain sensor, of 36 rays a pixel. Tests that change its capture copy it first."""
    from virtual_sensor.world import make_world

    return made_once(run_folder / "lab_world.pickle", lambda: make_world(run_folder / "lab_world", grid=6))


@pytest.fixture(scope="session")
def wide_world(run_folder):
    """The same in images large enough to match, of 9 rays a pixel."""
    from virtual_sensor.world import make_world

    make = lambda: make_world(run_folder / "wide_world", size=(160, 90), grid=3)  # noqa: E731
    return made_once(run_folder / "wide_world.pickle", make)


@pytest.fixture(scope="session")
def depth_capture(run_folder, wide_world):
    """The capture of wide_world by a device that measures depth."""
    from lab_worlds import with_device_depth

    make = lambda: with_device_depth(wide_world, run_folder / "depth_capture", ids=(0, 2, 4))  # noqa: E731
    return made_once(run_folder / "depth_capture.pickle", make)


@pytest.fixture(scope="session")
def lab_cache(run_folder):
    """Renders that every test of this run may take."""
    from activestereo.compare.cache import LayerCache

    return LayerCache(run_folder / "layers")


@pytest.fixture(scope="session")
def ball_comparison(run_folder, wide_world, depth_capture):
    """A lab Comparison with much to explain: see report_worlds.py."""
    from report_worlds import make_ball_comparison

    make = lambda: make_ball_comparison(wide_world, depth_capture, run_folder / "ball")  # noqa: E731
    return made_once(run_folder / "ball.pickle", make)


@pytest.fixture
def small_config():
    """SAPIEN's D435 of half the size, quick to render: fixed exposure, no optics, plain noise."""
    from activestereo import StereoDepthSensorConfig

    config = StereoDepthSensorConfig("sapien-D435").scaled(0.5)
    config.samples_per_pixel = 4
    config.max_bounces = 2
    return config
