# SPDX-License-Identifier: Apache-2.0
"""Calibrations in YAML of ROS, Kalibr and OpenCV: both cameras' lenses and places come out as they were put in."""

import re
import sys

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from activestereo.capture.capture import read_capture
from activestereo.capture.images import write_gray
from activestereo.capture.importers.calibration import read_calibration_yaml
from activestereo.cli import main
from activestereo.common.pose import rigid_motion

pytest.importorskip("yaml", reason="the package PyYAML is not installed (apt-get install python3-yaml)")

WIDTH, HEIGHT, BASELINE = 160, 120, 0.0625
K = {
    "left": np.array([[201.5, 0, 79], [0, 202.5, 61], [0, 0, 1]]),
    "right": np.array([[199.0, 0, 81], [0, 200, 58], [0, 0, 1]]),
}
LENS = {"left": [0.02, -0.01, 0.001, 0.0005, 0.003], "right": [-0.03, 0.02, -0.001, 1e-05, 0.0]}
R = {side: Rotation.from_euler("xyz", angles).as_matrix() for side, angles in
     (("left", (0.01, -0.02, 0.003)), ("right", (-0.004, 0.015, 0.002)))}  # fmt: skip
NEW_K = np.array([[190.0, 0, 80.5], [0, 190.0, 59.5], [0, 0, 1]])


def left_to_right():
    """By points: the same point in rectified axes differs by the baseline."""
    straight = np.linalg.inv(R["right"])
    return rigid_motion(straight @ [-BASELINE, 0, 0], straight @ R["left"])


def projection(side):
    shift = -NEW_K[0, 0] * BASELINE if side == "right" else 0.0
    return np.column_stack([NEW_K, [shift, 0.0, 0.0]])


def matrix(values, rows, columns):
    return f"\n  rows: {rows}\n  cols: {columns}\n  data: {[float(v) for v in np.ravel(values)]}"


def saved_by_ros(side, **changes):
    """A file as camera_calibration's cameracalibrator saves it."""
    fields = {
        "image_width": WIDTH, "image_height": HEIGHT, "camera_name": side, "camera_matrix": matrix(K[side], 3, 3),
        "distortion_model": "plumb_bob", "distortion_coefficients": matrix(LENS[side], 1, len(LENS[side])),
        "rectification_matrix": matrix(R[side], 3, 3), "projection_matrix": matrix(projection(side), 3, 4),
    }  # fmt: skip
    return "".join(f"{name}: {value}\n" for name, value in (fields | changes).items() if value is not None)


def echoed_by_ros(side, upper=True):
    """A message as rostopic echo and ros2 topic echo print it, with numbers such as 1e-05."""

    def name(text):
        return text if upper else text.lower()

    return (
        f'header:\n  stamp:\n    secs: 1\nheight: {HEIGHT}\nwidth: {WIDTH}\ndistortion_model: "plumb_bob"\n'
        f"{name('D')}: {LENS[side]}\n{name('K')}: {K[side].ravel().tolist()}\n{name('R')}: {R[side].ravel().tolist()}\n"
        f"{name('P')}: {projection(side).ravel().tolist()}\nbinning_x: 0\n---\n"
    )


def kalibr(first, second, motion, **changes):
    fields = {"camera_model": "pinhole", "distortion_model": "radtan"} | changes
    text = ""
    for name, side in (("cam0", first), ("cam1", second)):
        text += f"{name}:\n  cam_overlaps: [1]\n"
        text += "".join(f"  {key}: {value}\n" for key, value in fields.items() if value is not None)
        text += f"  distortion_coeffs: {LENS[side][:4]}\n  resolution: [{WIDTH}, {HEIGHT}]\n"
        text += f"  intrinsics: {[float(K[side][i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2))]}\n"
    return text + "  T_cn_cnm1:\n" + "".join(f"  - {row.tolist()}\n" for row in motion)


@pytest.fixture
def recording(tmp_path):
    """A pair 9 px apart."""
    noise = gaussian_filter(np.random.default_rng(3).normal(0.0, 1.0, (HEIGHT, WIDTH + 9)), 1.2)
    noise = np.clip(np.rint(120.0 + 40.0 * noise / noise.std()), 0, 255).astype(np.uint8)
    for side, first in (("left", 0), ("right", 9)):
        (tmp_path / "set" / side).mkdir(parents=True)
        write_gray(tmp_path / "set" / side / "000001.png", noise[:, first : first + WIDTH])
    return tmp_path / "set"


@pytest.fixture
def imported(recording, tmp_path):
    """Imports with these texts as calibrations; the exit status."""

    def run(*texts, more=()):
        arguments = ["import", str(recording), "-o", str(tmp_path / "out"), *more]
        for i, text in enumerate(texts):
            (tmp_path / f"{i}.yaml").write_text(text)
            arguments += ["--calibration", str(tmp_path / f"{i}.yaml")]
        return main(arguments)

    return run


def assert_raw(rig, lens_numbers):
    for side in ("left", "right"):
        np.testing.assert_allclose(rig.camera(side).K, K[side])
        np.testing.assert_allclose(rig.camera(side).distortion[:lens_numbers], LENS[side][:lens_numbers])
    np.testing.assert_allclose(rig.left_to_right, left_to_right(), atol=1e-9)


@pytest.mark.parametrize("order", [("left", "right"), ("right", "left")])
def test_ros_files_of_both_cameras_in_any_order(imported, tmp_path, capsys, order):
    assert imported(*map(saved_by_ros, order)) == 0
    assert_raw(read_capture(tmp_path / "out").rig, 5)
    assert "cameras: not rectified, by this calibration" in capsys.readouterr().out


@pytest.mark.parametrize("upper", [True, False])
def test_echoed_messages_of_ros_in_one_file(imported, tmp_path, upper):
    assert imported(echoed_by_ros("left", upper) + echoed_by_ros("right", upper)) == 0
    assert_raw(read_capture(tmp_path / "out").rig, 5)


@pytest.mark.parametrize(
    "model, numbers",
    [
        ("rational_polynomial", [0.1, 0.2, 0.001, 0.002, 0.3, 0.11, 0.21, 0.31]),
        ("equidistant", [0.1, 0.02, 0.001, 0.002]),
    ],
)
def test_a_lens_of_ros_keeps_its_numbers(imported, tmp_path, model, numbers):
    changes = {"distortion_model": model, "distortion_coefficients": matrix(numbers, 1, len(numbers))}
    assert imported(saved_by_ros("left", **changes), saved_by_ros("right", **changes)) == 0
    np.testing.assert_array_equal(read_capture(tmp_path / "out").rig.right.distortion, numbers)


@pytest.mark.parametrize("first, second", [("left", "right"), ("right", "left")])
def test_kalibrs_chain_tells_by_its_motion_which_camera_is_left(imported, tmp_path, first, second):
    motion = left_to_right() if first == "left" else np.linalg.inv(left_to_right())
    fisheye = {} if first == "left" else {"distortion_model": "equi"}
    assert imported(kalibr(first, second, motion, **fisheye)) == 0
    assert_raw(read_capture(tmp_path / "out").rig, 4)


def without_baseline(side, **changes):
    return saved_by_ros(side, projection_matrix=matrix(projection("left"), 3, 4), **changes)


@pytest.mark.parametrize("names", [("left", "right"), ("infra1", "infra2"), ("a", "b")])
@pytest.mark.parametrize("are_rectified", [True, False])
def test_cameras_of_ros_whose_p3_is_0_take_the_baseline_of_the_option(imported, tmp_path, names, are_rectified):
    texts = [without_baseline(side, camera_name=name) for side, name in zip(("left", "right"), names, strict=True)]
    order = texts if names[0] == "a" else texts[::-1]  # names tell the side, else the first file is the left camera's
    more = ["--baseline", str(BASELINE), *(["--rectified"] if are_rectified else [])]
    assert imported(*order, more=more) == 0
    rig = read_capture(tmp_path / "out").rig
    assert rig.baseline_m == pytest.approx(BASELINE)
    if not are_rectified:
        assert_raw(rig, 5)


def opencv_matrix(name, values, rows, columns):
    numbers = ", ".join(f"{float(value):.17g}" for value in np.ravel(values))
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {numbers} ]\n"


def opencv(motion, unit=1.0, lens_numbers=5, more=""):
    """A FileStorage of the names of OpenCV's sample stereo_calib, and with P1 and P2."""
    text = "%YAML:1.0\n---\n" + more
    for number, side in ((1, "left"), (2, "right")):
        text += opencv_matrix(f"M{number}", K[side], 3, 3)
        text += opencv_matrix(f"D{number}", (LENS[side] + 9 * [0.0])[:lens_numbers], 1, lens_numbers)
        P = projection(side) * [1.0, 1.0, 1.0, unit]
        text += opencv_matrix(f"P{number}", P, 3, 4)
    return text + opencv_matrix("R", motion[:3, :3], 3, 3) + opencv_matrix("T", unit * motion[:3, 3], 3, 1)


@pytest.mark.parametrize("lens_numbers", [4, 5, 8, 14])
def test_opencvs_matrices_are_read(imported, tmp_path, lens_numbers):
    assert imported(opencv(left_to_right(), lens_numbers=lens_numbers)) == 0
    assert_raw(read_capture(tmp_path / "out").rig, min(lens_numbers, 5))


@pytest.mark.parametrize("suffix", [".yml", ".yaml", ".json"])
def test_what_opencv_itself_writes_into_two_files_is_read(recording, tmp_path, suffix):
    motion, arguments = left_to_right(), []
    sides = (("1", "left"), ("2", "right"))
    intrinsics = {name + number: of[side] for number, side in sides for name, of in (("M", K), ("D", LENS))}
    for name, values in (("in", intrinsics), ("ex", {"R": motion[:3, :3], "T": motion[:3, 3:]})):
        path = str(tmp_path / f"{name}trinsics{suffix}")
        storage = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
        for key, value in values.items():
            storage.write(key, np.atleast_2d(np.array(value)))
        storage.release()
        arguments += ["--calibration", path]
    assert main(["import", str(recording), "-o", str(tmp_path / "out"), *arguments]) == 0
    assert_raw(read_capture(tmp_path / "out").rig, 5)


@pytest.mark.parametrize("files", [[*map(saved_by_ros, ("left", "right"))], [opencv(left_to_right())]])
def test_rectified_images_have_the_projection_matrices(imported, tmp_path, capsys, files):
    assert imported(*files, more=["--rectified"]) == 0
    rig = read_capture(tmp_path / "out").rig
    assert rig.left.is_pinhole and rig.right.is_pinhole and rig.baseline_m == pytest.approx(BASELINE)
    np.testing.assert_array_equal([rig.left.K, rig.right.K], [NEW_K, NEW_K])
    np.testing.assert_array_equal(rig.left_to_right[:3, :3], np.eye(3))
    assert "not rectified" not in capsys.readouterr().out


def test_opencvs_camera_1_may_be_the_right_one(imported, tmp_path):
    names = {f"{name}{a}:": f"{name}{b}:" for name in "MDP" for a, b in ((1, 2), (2, 1))}
    text = opencv(np.linalg.inv(left_to_right()))
    assert imported("".join(names.get(word, word) for word in re.split(r"(\b[MDP][12]:)", text))) == 0
    assert_raw(read_capture(tmp_path / "out").rig, 5)


MILLIMETRES = {
    "ros": [saved_by_ros(side, projection_matrix=matrix(projection(side) * [1, 1, 1, 1000], 3, 4))
            for side in ("left", "right")],
    "kalibr": [kalibr("left", "right", left_to_right() * np.array([1, 1, 1, 1000.0]) + np.diag([0, 0, 0, -999.0]))],
    "opencv": [opencv(left_to_right(), unit=1000.0)],
}  # fmt: skip


@pytest.mark.parametrize("kind", MILLIMETRES)
def test_a_baseline_that_can_only_be_millimetres_is_asked_about(imported, tmp_path, capsys, kind):
    assert imported(*MILLIMETRES[kind]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1 and "is it in millimetres? Then give --baseline 0.0625" in error[0]
    assert imported(*MILLIMETRES[kind], more=["--baseline", "0.0625"]) == 0
    assert_raw(read_capture(tmp_path / "out").rig, 4)


def test_a_baseline_beside_a_file_that_tells_another_is_refused(imported, capsys):
    assert imported(saved_by_ros("left"), saved_by_ros("right"), more=["--baseline", "0.12"]) == 2
    assert "the baseline is 0.0625 m, --baseline 0.12: leave out --baseline" in capsys.readouterr().err


# Ten levels of nine aliases: 3 486 784 401 texts behind a kilobyte.
BOMB = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 10)
)
MERGES = "b0: &b0 {x: 1}\n" + "".join(f"b{n}: &b{n} {{<<: [{', '.join([f'*b{n - 1}'] * 9)}]}}\n" for n in range(1, 10))


@pytest.mark.parametrize("key", ["header", *re.findall(r"^(\w+):", saved_by_ros("left"), re.M)])
@pytest.mark.parametrize("value", ["*a9", "[*a9, *a9, *a9]", "{data: *a9}", "!!bool foo", '!!int ""', '!!float ""',
                                   "!!timestamp foo", "!!binary foo", "!!set [1]", "1:1:1:1", "2020-13-45", "!!null x",
                                   "!!python/name:os.system", "&r [*r]", '"\\UFFFFFFFF"', "0x" + 5000 * "f",
                                   "9" * 5000, "\u001b[31m"])  # fmt: skip
def test_no_value_of_yaml_hangs_or_is_no_valueerror(tmp_path, key, value):
    files = [tmp_path / "left.yaml", tmp_path / "right.yaml"]
    files[0].write_text(BOMB + saved_by_ros("left", **{key: value}))
    files[1].write_text(saved_by_ros("right"))
    try:
        read_calibration_yaml(files)
    except ValueError as error:
        assert "left.yaml" in str(error) and len(str(error)) < 600


def test_merge_keys_are_not_expanded(imported, capsys):
    assert imported(MERGES + saved_by_ros("left"), saved_by_ros("right")) == 0


@pytest.mark.parametrize(
    "texts, said",
    [
        ([saved_by_ros("left")], "1 camera of ROS, expected both cameras: give --calibration twice"),
        ([without_baseline("left"), without_baseline("right")], "the baseline is nowhere in it: give --baseline M"),
        ([saved_by_ros("right"), saved_by_ros("right")], "P[3] of the cameras is -11.875 and -11.875, expected 0 of"),
        ([opencv(left_to_right()).split("R: ")[0]], "R: is missing: give --calibration twice"),
        ([opencv(left_to_right(), lens_numbers=14).replace("0, 0 ]", "0, 0.5 ]", 1)], "D1: has a thin prism"),
        ([saved_by_ros("left"), saved_by_ros("right", camera_matrix=None)], "1.yaml: camera_matrix: is missing"),
        ([saved_by_ros("left"), saved_by_ros("right", image_width="wide")], "image_width: is 'wide', expected a whole"),
        ([saved_by_ros("left"), saved_by_ros("right", distortion_model="omni")], "is 'omni'"),
        ([saved_by_ros("left"), saved_by_ros("right", camera_matrix="[1, 2]")], "camera_matrix: has 2 entries"),
        ([saved_by_ros("left"), saved_by_ros("right", camera_matrix=matrix(np.zeros(9), 3, 3))], "is no camera matrix"),
        ([saved_by_ros("left"), saved_by_ros("right", rectification_matrix=matrix(np.ones(9), 3, 3))],
         "rectification_matrix"),
        ([saved_by_ros("left").replace("201.5", "many"), saved_by_ros("right")], "camera_matrix[0]: is 'many'"),
        ([saved_by_ros("left", image_width=320), saved_by_ros("right", image_width=320)], "there are: 320x120"),
        ([kalibr("left", "right", left_to_right(), camera_model="omni")], "camera_model: is 'omni', expected pinhole"),
        ([kalibr("left", "right", left_to_right()[:3])], "cam1: T_cn_cnm1: has 12 entries, expected 16 numbers"),
        ([kalibr("left", "right", left_to_right()).split("cam1")[0]], "cam1: is missing: a pair has cam0 and cam1"),
        ([kalibr("left", "right", left_to_right()), saved_by_ros("left")], "Kalibr's chain of all"),
        (["a: [1"], "0.yaml: is not YAML: "),
        (["[" * 5000], "0.yaml: is n"),
        (["- 1\n"], "0.yaml: has no mapping"),
        ([""], "0.yaml: has no mapping"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_in_one_line_with_file_and_key(imported, tmp_path, capsys, texts, said):
    assert imported(*texts) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1 and said in error[0] and ".yaml" in error[0]
    assert not (tmp_path / "out").exists()


def test_what_belongs_to_ros_alone_is_refused_elsewhere(recording, imported, tmp_path, capsys):
    (tmp_path / "d435.txt").write_text("")
    text = ["import", str(recording), "-o", str(tmp_path / "out"), "--calibration", str(tmp_path / "d435.txt")]
    assert main([*text, "--rectified"]) == 2
    assert main([*text, "--calibration", str(tmp_path / "d435.txt")]) == 2
    assert imported(kalibr("left", "right", left_to_right()), more=["--rectified"]) == 2
    assert imported(saved_by_ros("left"), saved_by_ros("right"), more=["--k", "1,1,1,1"]) == 2
    said = capsys.readouterr().err
    for words in ("--rectified is about ROS'", "--calibration is given twice", "give no --rectified", "or --k"):
        assert words in said


def test_without_pyyaml_the_package_is_named(imported, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "yaml", None)
    assert imported(saved_by_ros("left"), saved_by_ros("right")) == 2
    assert "PyYAML, which is missing: apt-get install python3-yaml, or pip install pyyaml" in capsys.readouterr().err
