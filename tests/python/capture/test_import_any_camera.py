# SPDX-License-Identifier: Apache-2.0
"""Folders of any camera's images become captures: what is assumed is said, and pairs that are no pairs are refused."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from activestereo.capture.camera_order import camera_order
from activestereo.capture.capture import read_capture
from activestereo.capture.images import write_gray
from activestereo.capture.importers.realsense_folder import frame_files
from activestereo.cli import main
from command_line import led_on, refused

DISPARITY_PX, LOWER_PX = 9.0, 0.4


@pytest.fixture(scope="module")
def pair():
    """Smoothed noise whose right image lies 9 px further left and 0.4 px lower."""
    left = gaussian_filter(np.random.default_rng(3).normal(0.0, 1.0, (240, 424)), 1.5)
    left = 120.0 + 40.0 * left / left.std()
    right = shift(left, (LOWER_PX, -DISPARITY_PX), order=3, mode="nearest")
    return tuple(np.rint(np.clip(image, 0, 255)).astype(np.uint8) for image in (left, right))


@pytest.fixture
def recording(pair, tmp_path):
    """Two views as public data sets lay them out: a folder each, two kinds of depth, 8-bit images in 16-bit files."""
    for view in ("view_17", "view_20"):
        (tmp_path / "set" / view).mkdir(parents=True)
        for name, image in zip(("left", "right"), pair, strict=True):
            write_gray(tmp_path / "set" / view / f"img_{name}.png", image.astype(np.uint16))
        for kind, millimetres in (("laser", 1500), ("own", 1400)):
            write_gray(tmp_path / "set" / view / f"img_depth_{kind}.png", np.full((240, 424), millimetres, np.uint16))
    return tmp_path / "set"


def _import(recording, *more):
    return main(["import", str(recording), "-o", str(recording.parent / "rec"), "--depth-scale", "0.001", *more])


@pytest.mark.parametrize("word", ["depth_laser", "laser"])
def test_k_and_baseline_do_without_a_file_of_calibration(recording, capsys, word):
    assert _import(recording, "--k", "300,301,211,119", "--baseline", "0.07", "--depth", word) == 0
    text = capsys.readouterr().out
    assert [words[0] for words in led_on(text)] == ["calibrate", "view"]
    told = " ".join(text.split())
    capture = read_capture(recording.parent / "rec")
    assert capture.rig.baseline_m == pytest.approx(0.07) and capture.rig.bit_depth == 8
    assert np.array_equal(capture.rig.right.K, [[300, 0, 211], [0, 301, 119], [0, 0, 1]])
    assert [frame.repeat_group for frame in capture.frames] == [None, None]
    assert capture.depth(capture.frames[1])[5, 5] == pytest.approx(1.5)
    assert "2 images are not used, such as view_17/img_depth_own.png" in told
    assert "nominal 5" not in told and "missing: no poses" in told


def test_what_nothing_tells_is_the_presets_and_said(recording, capsys):
    assert _import(recording, "--sensor", "d435", "--depth", "faro") == 2
    assert "0 PNG files have 'faro' in their names" in capsys.readouterr().err
    assert _import(recording, "--sensor", "d435", "--verbose") == 0
    told = capsys.readouterr().out
    capture = read_capture(recording.parent / "rec")
    assert capture.rig.left.K[0, 0] == pytest.approx(0.5 * 430.0, rel=0.05)
    assert "assumed: the baseline is d435's nominal" in told and "assumed: K is d435's nominal one" in told
    assert "missing: no depth" in told and "rows +0.39 px apart" in told


def test_swapped_cameras_and_a_foreign_k_are_refused(recording, capsys):
    assert _import(recording, "--swap") == 2
    assert "leave out --swap" in capsys.readouterr().err
    for view in recording.iterdir():
        (view / "img_left.png").rename(view / "third.png")
        (view / "img_right.png").rename(view / "img_left.png")
        (view / "third.png").rename(view / "img_right.png")
    assert _import(recording) == 2
    assert "left and right are swapped: 100 %" in capsys.readouterr().err
    assert not (recording.parent / "rec").exists()
    assert _import(recording, "--swap") == 0
    assert _import(recording.with_name("none"), "--k", "600,600,424,240") == 2
    capsys.readouterr()
    arguments = ["import", recording, "--swap", "-o", recording.parent / "other", "--k", "600,600,640,240"]
    assert "outside of the images' 424x240: were they rescaled?" in refused(arguments, capsys)


def test_order_and_rows_are_told_from_images_alone(pair):
    order = camera_order([pair])
    assert order.is_told and not order.is_swapped and order.nearer_right == 0.0
    assert order.row_offset_px == pytest.approx(LOWER_PX, abs=0.05)
    assert camera_order([pair[::-1]]).is_swapped
    grey = np.full((240, 424), 80, np.uint8)
    assert not camera_order([(grey, grey)]).is_told


# ---- calibrations that are no YAML ----

MIDDLEBURY = """cam0=[300.5 0 211; 0 300.5 119; 0 0 1]
cam1=[300.5 0 {cx1}; 0 300.5 119; 0 0 1]
doffs={doffs}
baseline=193.001
width=424
height=240
ndisp=64
isint=0
"""


def test_middleburys_calibration_has_two_principal_points(recording, capsys):
    (recording.parent / "calib.txt").write_text(MIDDLEBURY.format(cx1=242.086, doffs=31.086))
    assert _import(recording, "--calibration", str(recording.parent / "calib.txt"), "--depth", "laser") == 0
    rig = read_capture(recording.parent / "rec").rig
    assert rig.baseline_m == pytest.approx(0.193001) and rig.right.K[0, 2] - rig.left.K[0, 2] == pytest.approx(31.086)
    assert "rows +0.39 px apart" in capsys.readouterr().out


def test_a_second_principal_point_moves_what_is_infinitely_far(recording, pair, capsys):
    """A pair that lies 9 px further right is swapped, unless cx of the right camera is as far right."""
    for view in recording.iterdir():
        for name, image in zip(("left", "right"), pair[::-1], strict=True):
            write_gray(view / f"img_{name}.png", image.astype(np.uint16))
    lens = ["--k", "300,301,211,119", "--baseline", "0.07", "--depth", "laser"]
    assert _import(recording, *lens) == 2
    assert "left and right are swapped" in capsys.readouterr().err
    assert _import(recording, *lens, "--k-right", f"300,301,{211 + DISPARITY_PX + 5},119") == 0


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("calib.txt", MIDDLEBURY.format(cx1=242.0, doffs=0), "doffs: is 0, expected cx1 - cx0, which is 31 px"),
        ("calib.txt", MIDDLEBURY.format(cx1="x", doffs=0), "cam1[2]: is 'x', expected a finite number"),
        ("calib.txt", "cam0=[1 0 1; 0 1 1; 0 0 1]\n", "cam1: is missing"),
        ("calib.txt", MIDDLEBURY.format(cx1=211, doffs=0).replace("424", "424.5"), "width[0]: is '424.5', expected a"),
        ("calib.txt", MIDDLEBURY.format(cx1=211, doffs=0).replace("193.001", "193001"),
         "the baseline is 193.001 m, more than any pair of depth cameras is apart: is it in millimetres?"),
        ("other.json", "{}", "image_width: is missing"),
    ],
)  # fmt: skip
def test_a_calibration_that_cannot_be_is_told_in_one_line(recording, capsys, name, text, said):
    path = recording.parent / name
    path.write_text(text)
    assert _import(recording, "--calibration", str(path), "--depth", "laser") == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1 and said in error[0] and name in error[0]
    assert not (recording.parent / "rec").exists()


@pytest.mark.parametrize("baseline", ["50", "193.001", "4.5"])
def test_a_baseline_in_millimetres_is_asked_about(recording, capsys, baseline):
    with pytest.raises(SystemExit) as ended:
        _import(recording, "--k", "300,301,211,119", "--baseline", baseline)
    assert ended.value.code == 2
    assert f"is it in millimetres? Then give --baseline {float(baseline) / 1000:g}" in capsys.readouterr().err


# ---- folders with links ----

LINKS = {
    "to itself": {"left": ".", "right": "."},
    "to its parent": {"left": "..", "right": "..", "desk/left": "..", "desk/right": ".."},
    "to each other": {"a_left": "b_right", "b_right": "a_left", "left": "desk", "desk/right": "../left"},
    "many to one": {f"left_right_{i}": "desk" for i in range(20)} | {f"desk/left_right_{i}": ".." for i in range(20)},
}


@pytest.mark.parametrize("links", LINKS.values(), ids=LINKS.keys())
def test_links_that_lead_back_are_not_followed(pair, tmp_path, links):
    folder = tmp_path / "set"
    (folder / "desk").mkdir(parents=True)
    for where in (folder, folder / "desk"):
        for name, image in zip(("left", "right"), pair, strict=True):
            write_gray(where / f"{name}_1.png", image)
    for name, target in links.items():
        (folder / name).symlink_to(target)
    found = frame_files(folder)
    assert 1 <= len(found) <= 2 and all(entry.files["left"].is_file() for entry in found)


def test_a_linked_view_is_a_view(pair, tmp_path):
    for name, image in zip(("left", "right"), pair, strict=True):
        (tmp_path / "elsewhere").mkdir(exist_ok=True)
        write_gray(tmp_path / "elsewhere" / f"{name}_1.png", image)
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "desk").symlink_to(tmp_path / "elsewhere")
    assert len(frame_files(tmp_path / "set")) == 1


def test_an_edge_that_runs_sideways_tells_no_row():
    rng, (height, width) = np.random.default_rng(3), (240, 424)
    v, u = np.mgrid[:height, : width + 10]
    scene = 60.0 + 80.0 / (1.0 + np.exp(-(v % 80 - 40 + 0.08 * u)))  # slanted edges, eighty rows apart
    scene[:, 200:300] += rng.uniform(0, 60, (height, 100))
    pair = [image + rng.normal(0, 1.0, image.shape) for image in (scene[:, :-10], scene[:, 10:])]
    order = camera_order([pair])
    assert 30 <= order.patches < 60 and order.row_spread_px < 0.1 and not order.is_swapped
    assert order.row_offset_px == pytest.approx(0.0, abs=0.05)
