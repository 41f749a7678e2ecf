# SPDX-License-Identifier: Apache-2.0
"""The cameras of a pair that 'activestereo depth' matches: two principal points, calibrations in every format, and a
word where they cannot be."""

import json

import numpy as np
import pytest
from PIL import Image

from activestereo.cli import main
from command_line import run_here

F_PX, BASELINE_M, SHIFT_PX, OFFSET_PX, WIDTH, HEIGHT = 100.0, 0.06, 12, 8.0, 128, 96
CX, CY = 63.5, 47.5
DEPTH_M = F_PX * BASELINE_M / (SHIFT_PX + OFFSET_PX)


@pytest.fixture
def pair(tmp_path):
    """A wall at one disparity, as a pair of files and, in a folder, as a recording."""
    wall = np.random.default_rng(1).integers(20, 200, (HEIGHT, WIDTH + SHIFT_PX), np.uint8)
    for side, first in (("left", 0), ("right", SHIFT_PX)):
        (tmp_path / "rec" / side).mkdir(parents=True)
        Image.fromarray(wall[:, first : first + WIDTH]).save(tmp_path / "rec" / side / "1.png")
    return tmp_path


def rows(K):
    return [float(value) for value in np.ravel(K)]


def matrix(cx, shift=None):
    K = [[F_PX, 0, cx], [0, F_PX, CY], [0, 0, 1]]
    return rows(K if shift is None else np.column_stack([K, [shift, 0, 0]]))


def ros(cx, shift):
    size = f"image_width: {WIDTH}\nimage_height: {HEIGHT}\n"
    return f"{size}K: {matrix(cx)}\nD: []\nR: {rows(np.eye(3))}\nP: {matrix(cx, shift)}\n"


CALIBRATIONS = {
    "middlebury": ["cam0=[100 0 63.5; 0 100 47.5; 0 0 1]\ncam1=[100 0 71.5; 0 100 47.5; 0 0 1]\ndoffs=8\nbaseline=60\n"
                   f"width={WIDTH}\nheight={HEIGHT}\n"],
    "opencv": [f"%YAML:1.0\n---\nM1: {{data: {matrix(CX)}}}\nM2: {{data: {matrix(CX + OFFSET_PX)}}}\nD1: [0, 0, 0, 0]\n"
               f"D2: [0, 0, 0, 0]\nR: {rows(np.eye(3))}\nT: [-0.06, 0, 0]\n"],
    "ros": [ros(CX, 0.0), ros(CX + OFFSET_PX, -F_PX * BASELINE_M)],
    "ros without baseline": [ros(CX, 0.0), ros(CX + OFFSET_PX, 0.0)],
}  # fmt: skip
LEFT = ["--k", f"{F_PX},{F_PX},{CX},{CY}", "--baseline", "0.06"]
OPTIONS = ["--k", f"{F_PX},{F_PX},{CX},{CY}", "--k-right", f"{F_PX},{F_PX},{CX + OFFSET_PX},{CY}", "--baseline", "0.06"]


def given(folder, kind):
    if kind == "options":
        return OPTIONS
    words = ["--baseline", "0.06"] if kind == "ros without baseline" else []
    for number, text in enumerate(CALIBRATIONS[kind]):
        path = folder / f"{number}.{'txt' if kind == 'middlebury' else 'yml'}"
        path.write_text(text)
        words += ["--calibration", str(path)]
    return words


@pytest.mark.parametrize("kind", ["options", *CALIBRATIONS])
@pytest.mark.parametrize("is_recording", [False, True])
def test_depth_is_f_b_over_the_disparity_and_the_offset_of_cx(pair, kind, is_recording):
    files = [pair / "rec"] if is_recording else [pair / "rec/left/1.png", pair / "rec/right/1.png"]
    command = ["depth", *map(str, files), *given(pair, kind), "--max-disparity", "32", "--out", str(pair / "out")]
    assert main(command) == 0
    depth = np.asarray(Image.open(pair / "out" / ("000000.png" if is_recording else "depth.png")))
    assert np.median(depth[depth > 0]) == pytest.approx(1000 * DEPTH_M, abs=2)


def test_a_search_beside_truth_knows_the_offset(pair, capsys):
    truth = pair / "truth"
    truth.mkdir()
    Image.fromarray(np.full((HEIGHT, WIDTH), round(1000 * DEPTH_M), np.uint16)).save(truth / "1.png")
    words = ["--search", "truth", str(pair / "s.json"), "--truth", str(truth), "--max-disparity", "32", "--json"]
    assert main(["depth", str(pair / "rec"), *OPTIONS, *words]) == 0
    assert json.loads(capsys.readouterr().out)["after"]["wrong"] < 0.3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "a pair of images needs --k, --baseline (or --calibration FILE)"),
        (["--k", "100,100,63.5,47.5", "--baseline", "60"], "is it in millimetres? Then give --baseline 0.06"),
        ([*LEFT, "--k-right", "100,100,600,47.5"], "--k-right has its centre at 600, 47.5, outside"),
        ([*LEFT, "--k-right", "150,150,63.5,47.5"], "do not match: focal lengths of 100 and 150 px"),
        (["--calibration", "{folder}/turned.yml"], "turned.yml: the pairs are not rectified, its cameras have a lens"),
        (["--calibration", "{folder}/none.yml"], "No such file"),
        (["--calibration", "{folder}/turned.yml", *OPTIONS[:2]], "--calibration tells K of both cameras"),
    ],
)
def test_cameras_that_cannot_be_are_told_in_one_line(pair, capsys, words, said):
    turned = "R: [0.995, -0.0998, 0, 0.0998, 0.995, 0, 0, 0, 1]"
    (pair / "turned.yml").write_text(CALIBRATIONS["opencv"][0].replace(f"R: {rows(np.eye(3))}", turned))
    command = ["depth", pair / "rec/left/1.png", pair / "rec/right/1.png", "--out", pair / "out"]
    result = run_here(capsys, *command, *(word.format(folder=pair) for word in words))
    error = result.stderr.strip().splitlines()
    assert result.returncode == 2 and len(error) == 1 and said in error[0]
