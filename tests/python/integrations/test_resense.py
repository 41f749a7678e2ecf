# SPDX-License-Identifier: Apache-2.0
"""Stored demonstrations seen again: what moved in the states moves in depth, and bad files are told."""

import re

import numpy as np
import pytest
from PIL import Image

h5py = pytest.importorskip("h5py", reason="the package h5py is not installed (pip install h5py)")
pytest.importorskip("mujoco", reason="the package mujoco is not installed (pip install mujoco)")

from activestereo.cli import main  # noqa: E402
from activestereo.integrations.resense import read_demos  # noqa: E402

_MJCF = """<mujoco><worldbody><light pos="0 0 2"/>
<geom type="box" size="2 2 .02" pos="0 0 -.02" group="1"/><geom type="box" size="2 2 .01" pos="0 0 .8" group="0"/>
<body name="block"><joint type="slide" axis="0 0 1"/><geom type="box" size=".2 .2 .1" group="1"/></body>
<camera name="above" pos="0 0 1.2"/></worldbody></mujoco>"""


def _write(path, states, **attributes):
    with h5py.File(path, "w") as file:
        group = file.create_group("data/demo_1")
        group["states"] = states
        group.attrs.update(attributes)
    return path


def _depth_m(path):
    depth = np.asarray(Image.open(path))[50:70, 96:116]
    return np.median(depth[depth > 0]) / 1000.0


def test_a_block_that_rises_in_the_states_rises_in_depth(tmp_path):
    states = [[0.0, 0.1, 0.0], [0.1, 0.2, 0.0], [0.2, 0.3, 0.0]]
    demos = _write(tmp_path / "demo.hdf5", states, model_file=_MJCF)
    out = tmp_path / "out"
    options = ["--size", "212x120", "--spp", "8", "--every", "2", "--out", str(out)]
    assert main(["resense", str(demos), *options]) == 0
    names = [path.name for path in sorted((out / "demo_1/depth").iterdir())]
    assert names == ["000000.png", "000002.png"]
    for name, truth_m in zip(names, (1.0, 0.8), strict=True):  # the top of the block, 0.1 m above its middle
        assert _depth_m(out / "demo_1/depth_true" / name) == pytest.approx(truth_m, abs=0.002)
        assert _depth_m(out / "demo_1/depth" / name) == pytest.approx(truth_m, rel=0.05)
    assert {path.name for path in (out / "demo_1").iterdir()} == {"depth", "depth_true", "ir_left", "ir_right", "cause"}


@pytest.mark.parametrize(
    ("states", "attributes", "text"),
    [
        ([[0.0, 0.1]], {"model_file": _MJCF}, r"states are \(1, 2\), expected \[T, 3 or more\]"),
        ([[0.0, 0.1, 0.0], [0.0, np.nan, 0.0]], {"model_file": _MJCF}, "state 1 has values that are no numbers"),
        ([[0.0]], {"model_file": "<mujoco><geom/></mujoco>"}, "MuJoCo cannot load its model"),
        ([[0.0]], {}, "no attribute model_file"),
    ],
)
def test_bad_demonstrations_are_told(tmp_path, capsys, states, attributes, text):
    demos = _write(tmp_path / "demo.hdf5", states, **attributes)
    assert main(["resense", str(demos), "--size", "64x64", "--out", str(tmp_path / "out")]) == 2
    assert re.search(text, capsys.readouterr().err)


def test_other_files_are_told(tmp_path):
    (tmp_path / "a.hdf5").write_text("none")
    with pytest.raises(ValueError, match="is no HDF5 file"):
        list(read_demos(tmp_path / "a.hdf5"))
    h5py.File(tmp_path / "b.hdf5", "w").close()
    with pytest.raises(ValueError, match="has no demonstrations"):
        list(read_demos(tmp_path / "b.hdf5"))
