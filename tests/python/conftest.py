# SPDX-License-Identifier: Apache-2.0
"""The built packages come from ACTIVESTEREO_BUILD, else from build/ beside the sources."""

import os
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
    from activestereo.scene import write_table_top

    path = tmp_path_factory.mktemp("scene") / "table_top.gltf"
    write_table_top(path)
    return path


@pytest.fixture(scope="session")
def device():
    import kuafu

    return kuafu.Device()


@pytest.fixture(scope="session")
def ball_comparison(tmp_path_factory):
    """A lab Comparison with much to explain: see report_worlds.py."""
    from report_worlds import make_ball_comparison

    return make_ball_comparison(tmp_path_factory.mktemp("ball"))


@pytest.fixture
def small_config():
    """SAPIEN's D435 of half the size, quick to render: fixed exposure, no optics, plain noise."""
    from activestereo import StereoDepthSensorConfig

    config = StereoDepthSensorConfig("sapien-D435").scaled(0.5)
    config.samples_per_pixel = 4
    config.max_bounces = 2
    return config
