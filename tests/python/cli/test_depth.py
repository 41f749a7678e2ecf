# SPDX-License-Identifier: Apache-2.0
"""'activestereo depth': the cameras of a pair, and a folder's pairs, interrupted and gone on with."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from activestereo.cli import depth as depth_command
from activestereo.cli import main
from activestereo.cli.depth import depth_hints

F_PX, BASELINE_M, SHIFT_PX, OFFSET_PX, WIDTH, HEIGHT = 100.0, 0.06, 12, 8.0, 128, 96
CX, CY = 63.5, 47.5
LEFT = ["--k", f"{F_PX},{F_PX},{CX},{CY}", "--baseline", str(BASELINE_M)]
OPTIONS = [*LEFT, "--k-right", f"{F_PX},{F_PX},{CX + OFFSET_PX},{CY}"]


@pytest.fixture
def recording(tmp_path):
    """Three pairs of one wall, at a known disparity."""
    folder = tmp_path / "recording"
    (folder / "left").mkdir(parents=True)
    (folder / "right").mkdir()
    rng = np.random.default_rng(1)
    for number in range(3):
        wall = rng.integers(20, 200, (HEIGHT, WIDTH + SHIFT_PX), np.uint8)
        Image.fromarray(wall[:, :WIDTH]).save(folder / "left" / f"{number}.png")
        Image.fromarray(wall[:, SHIFT_PX:]).save(folder / "right" / f"{number}.png")
    return folder


def settings(path, **values):
    path.write_text(json.dumps({name.replace("_", "-"): value for name, value in values.items()}))
    return str(path)


def depth(recording, out, *more):
    return main(["depth", str(recording), *LEFT, "--out", str(out), "--max-disparity", "32", *more])


def values(path):
    image = np.asarray(Image.open(path))
    return np.median(image[image > 0])


def test_depth_has_the_settings_units_and_the_recording_stays(recording, tmp_path, capsys):
    before = {path: path.read_bytes() for path in recording.rglob("*.png")}
    file = settings(tmp_path / "s.json", param_depthunits="100", param_lambdaad="1")
    assert depth(recording, tmp_path / "out", "--settings", file) == 0
    assert values(tmp_path / "out/000002.png") == pytest.approx(1e4 * F_PX * BASELINE_M / SHIFT_PX, abs=60)
    assert "without effect here: param-lambdaad" in capsys.readouterr().out
    assert {path: path.read_bytes() for path in recording.rglob("*.png")} == before
    assert depth(recording, tmp_path / "d", "--settings", settings(tmp_path / "d.json", param_disparitymode=1)) == 0
    assert values(tmp_path / "d/000000.png") == pytest.approx(32 * SHIFT_PX, abs=4)


def test_a_run_that_was_interrupted_goes_on_and_keeps_what_it_had(recording, tmp_path, monkeypatch, capsys):
    real, calls = depth_command._image, []

    def second_fails(*given):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*given)

    monkeypatch.setattr(depth_command, "_image", second_fails)
    assert depth(recording, tmp_path / "out") != 0
    kept = tmp_path / "out/000000.png"
    first = kept.read_bytes()
    assert values(kept) == pytest.approx(1e3 * F_PX * BASELINE_M / SHIFT_PX, abs=6)
    capsys.readouterr()
    assert depth(recording, tmp_path / "out") == 0
    assert "2 pairs matched, 1 were there already" in capsys.readouterr().out
    assert kept.read_bytes() == first and len(list((tmp_path / "out").glob("*.png"))) == 3
    other = settings(tmp_path / "s.json", param_secondpeakdelta=600)
    assert depth(recording, tmp_path / "out", "--settings", other) == 2
    assert "holds depth of another run (settings, matcher differ)" in capsys.readouterr().err


def test_a_damaged_image_ends_the_run_in_one_line_and_the_pairs_before_stay(recording, tmp_path, capsys):
    damaged = recording / "left/2.png"
    damaged.write_bytes(damaged.read_bytes()[:400])
    assert depth(recording, tmp_path / "out") == 2
    assert "damaged" in (err := capsys.readouterr().err) and err.strip().splitlines()[-1].startswith("activestereo: ")
    assert sorted(path.name for path in (tmp_path / "out").glob("*.png")) == ["000000.png", "000001.png"]
    assert values(tmp_path / "out/000001.png") > 0


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
def test_depth_is_f_b_over_the_disparity_and_the_offset_of_cx(recording, tmp_path, kind, is_recording):
    files = [recording] if is_recording else [recording / "left/1.png", recording / "right/1.png"]
    words = [*files, *given(tmp_path, kind), "--max-disparity", "32", "--out", tmp_path / "out"]
    assert main(["depth", *map(str, words)]) == 0
    depth_m = F_PX * BASELINE_M / (SHIFT_PX + OFFSET_PX)
    found = values(tmp_path / "out" / ("000000.png" if is_recording else "depth.png"))
    assert found == pytest.approx(1000 * depth_m, abs=2)


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
        ([*LEFT, "--sensor", "d435"], "--sensor is for recordings, not for a pair of images: leave it out"),
        (
            [*LEFT, "--profile", "passive", "--out", "{folder}"],
            "--profile is for a pair of images, not for a recording",
        ),
        ([*LEFT, "--reason", "--out", "{folder}"], "--reason is for a pair of images, not for a recording"),
        ([*LEFT, "--out", "{folder}/depth"], "lies in the recording"),
        ([*LEFT, "--out", ""], "--out"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(recording, tmp_path, run, words, said):
    turned = "R: [0.995, -0.0998, 0, 0.0998, 0.995, 0, 0, 0, 1]"
    (recording / "turned.yml").write_text(CALIBRATIONS["opencv"][0].replace(f"R: {rows(np.eye(3))}", turned))
    files = [recording] if "--out" in words else [recording / "left/1.png", recording / "right/1.png"]
    result = run("depth", *files, "--out", tmp_path / "out", *(word.format(folder=recording) for word in words))
    error = result.stderr.strip().splitlines()
    assert result.returncode == 2 and len(error) == 1 and said in error[0]


def test_disparities_beyond_the_largest_depth_do_not_hide_that_images_are_exchanged():
    """As given, all pixels match by chance at 12 m; exchanged, all have depth."""
    image, limits = np.zeros((8, 8), np.uint8), {"min_depth_m": 0.1, "max_depth_m": 10.0}
    engine = SimpleNamespace(
        parameters=limits, compute=lambda *pair: {n: np.ones((8, 8)) for n in ("depth", "disparity")}
    )
    found = {"disparity": np.full((8, 8), 0.5), "depth": np.zeros((8, 8))}
    cameras = SimpleNamespace(focal_baseline_px_m=6.0, offset_px=0.0)
    told = depth_hints(cameras, engine, image, image, found)
    assert "64 pixels from 10 m on" in told[0] and "exchanged, the images give 100.0 % instead of 0.0 %" in told[1]
