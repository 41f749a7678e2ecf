# SPDX-License-Identifier: Apache-2.0
"""Recordings of librealsense's tools, written here as those tools write them, become captures."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift, uniform_filter

from activestereo.capture.capture import read_capture
from activestereo.capture.capture_json import CaptureError
from activestereo.cli import main
from activestereo.capture.images import read_gray, write_gray
from activestereo.capture.importers.realsense_text import read_device_text
from activestereo.capture.importers.frames import pose_at, read_trajectory
from activestereo.compare.compare import compare
from camera_dumps import ENUMERATED, write_pairs
from command_line import led_on, refused, run_here


@pytest.fixture
def recording(tmp_path):
    """Three frames under rs-convert's names, whose streams are a millisecond apart; the text beside them."""
    rng, folder = np.random.default_rng(0), tmp_path / "recording"
    folder.mkdir()
    for i in range(3):
        for stream, delay in (("Infrared 1", 0.0), ("Infrared 2", 0.2), ("Depth", 1.1)):
            kind, high = (np.uint16, 3000) if stream == "Depth" else (np.uint8, 255)
            name = f"run_{stream}_{1700000000000.5 + 33.3 * i + delay:.6f}.png"
            write_gray(folder / name, rng.integers(1, high, (48, 64)).astype(kind))
    (tmp_path / "d435.txt").write_text(ENUMERATED)
    return folder


def _arguments(recording, *more):
    out = recording.parent / "capture"
    return ["import", str(recording), "--calibration", str(recording.parent / "d435.txt"), "--out", str(out), *more]


def test_a_recording_becomes_a_capture(recording, capsys):
    assert main(_arguments(recording, "--verbose", "--exposure", "0.004,0.002,0.004")) == 0
    capture = read_capture(recording.parent / "capture")
    assert "exposure of 0.008" not in capsys.readouterr().out
    assert len(capture.frames) == 3 and {frame.repeat_group for frame in capture.frames} == {0}
    assert capture.rig.baseline_m == pytest.approx(0.0499585680663586) and capture.rig.left_to_right[0, 3] < 0
    assert np.array_equal(capture.rig.right.K, [[43.0, 0, 32.1], [0, 43.5, 24.2], [0, 0, 1]])
    assert capture.frames[1].timestamp_s == pytest.approx(1700000000.0338)
    assert [frame.exposure_s for frame in capture.frames] == [0.004, 0.002, 0.004]
    files = sorted(recording.glob("*Depth*"))
    assert capture.frames[2].depth_scale == 0.001
    assert np.allclose(capture.depth(capture.frames[2]), read_gray(files[2]) * 0.001)
    assert np.array_equal(capture.ir(capture.frames[1], "right"), read_gray(sorted(recording.glob("*Infrared 2*"))[1]))
    with pytest.raises(CaptureError, match="scene.gltf: the scene is empty: import --scene FILE"):
        compare(capture.path)


@pytest.mark.parametrize("kinds", [("laser",), ("laser", "own")])
def test_depth_of_another_name_is_taken_or_asked_about(recording, capsys, kinds):
    for number, file in enumerate(sorted(recording.glob("*Depth*"))):
        for kind in kinds:
            write_gray(recording / f"view{number}_depth_{kind}.png", np.full((48, 64), 900, np.uint16))
        file.unlink()
    for place, word in (("Infrared 1", "left"), ("Infrared 2", "right")):
        for number, file in enumerate(sorted(recording.glob(f"*{place}*"))):
            file.rename(recording / f"view{number}_{word}.png")
    end = run_here(capsys, *_arguments(recording))
    frames = read_capture(recording.parent / "capture").frames
    assert all((frame.depth_path is not None) == (len(kinds) == 1) for frame in frames)
    leads = [words for words in led_on(end.stdout) if words[0] == "import"]
    assert [words[words.index("--depth") + 1] for words in leads] == (list(kinds) if len(kinds) > 1 else [])
    for words in leads:
        assert "3 with depth" in run_here(capsys, *words).stdout


@pytest.mark.parametrize(
    ("steps", "groups"),
    [
        ((0.0, 0.0, 0.0), (0, 0, 0)),
        ((0.0, 0.5, 1.0), (None, None, None)),  # pixels by which a hand moves
        ((0.0, 9.0, 27.0), (None, None, None)),
        ((0.0, 0.0, 2.0, 2.0, 5.0), (0, 0, 1, 1, None)),
        ((0.0, None, 0.0, None), (0, 1, 0, 1)),  # the projector blinks
    ],
)
def test_frames_are_repeats_where_their_pictures_lie_on_each_other(recording, tmp_path, capsys, steps, groups):
    """Noise that neighbours and rows share, and a lamp that flickers, make no difference."""
    rng, folder = np.random.default_rng(1), tmp_path / "hand"
    dots = 40.0 * gaussian_filter(rng.normal(size=(96, 160)), 1.6) / 0.18
    wall = 60.0 + 25.0 * gaussian_filter(rng.normal(size=(96, 160)), 8.0) / 0.035
    for name in ("left", "right"):
        (folder / name).mkdir(parents=True)
        for k, step in enumerate(steps):
            seen = wall if step is None else shift(wall + np.maximum(dots, 0.0), (0.0, step), mode="nearest")
            noise = uniform_filter(rng.normal(size=(48, 64)), 2) * 3.0 + rng.normal(size=(48, 1))
            image = seen[24:72, 48:112] * (1.0 + 0.02 * k) + noise
            write_gray(folder / name / f"{k:03d}.png", np.rint(np.clip(image, 0, 255)).astype(np.uint8))
    main(_arguments(folder, "--verbose"))
    capture = read_capture(tmp_path / "capture")
    assert tuple(frame.repeat_group for frame in capture.frames) == groups
    views = len({*groups} - {None}) + groups.count(None)
    said = " ".join(capsys.readouterr().out.split())
    assert f"here are {len(steps)} frames of {views} views" in said and "exposure of 0.008 s" in said


@pytest.mark.parametrize(("sensor", "x_m"), [("d415", 0.029), ("d455", 0.047), ("d435", 0.0291)])
def test_the_projector_is_where_the_preset_has_it(recording, sensor, x_m):
    assert main(_arguments(recording, "--depth-scale", "0.001", "--sensor", sensor)) == 0
    left_to_projector = read_capture(recording.parent / "capture").rig.projector.left_to_projector
    assert left_to_projector[0, 3] == pytest.approx(-x_m, abs=1e-5)


def test_folders_of_cameras_and_a_trajectory(recording, tmp_path, capsys):
    folder = tmp_path / "cameras"
    write_pairs(folder, range(0, 40, 10))
    poses = tmp_path / "poses.txt"
    poses.write_text("# time tx ty tz qx qy qz qw\n0.0 0 0 0 0 0 0 1\n0.1 0.3 0 0 0 0 0.7071068 0.7071068\n")
    assert "1/30 s apart" in run_here(capsys, *_arguments(folder, "--poses", str(poses))).stdout
    capture = read_capture(tmp_path / "capture")
    assert "is a capture already" in refused(["import", capture.path, "--out", tmp_path / "again"], capsys)
    assert [frame.repeat_group for frame in capture.frames] == [None] * 4
    pose = capture.frames[1].camera_to_world
    assert pose[0, 3] == pytest.approx(0.1)
    assert np.rad2deg(np.arctan2(pose[1, 0], pose[0, 0])) == pytest.approx(30.0, abs=1e-3)
    assert capture.ir(capture.frames[3], "right")[0, 0] == 31


@pytest.mark.parametrize("names", ["{}/{}.png", "{1}_{0}.png", "{} {} 1.png"])
def test_names_without_numbers_of_their_own_are_paired_as_they_are(recording, tmp_path, names, capsys):
    folder, things = tmp_path / "named", ("view 10 desk", "view 9 desk", "cup")
    for stream in ("left", "right"):
        for value, thing in enumerate(things):
            file = folder / names.format(stream, thing)
            file.parent.mkdir(parents=True, exist_ok=True)
            write_gray(file, np.full((48, 64), 10 * value + (stream == "right"), np.uint8))
    assert main(_arguments(folder)) == 0
    capture = read_capture(tmp_path / "capture")
    seen = [(capture.ir(f, "left")[0, 0], capture.ir(f, "right")[0, 0]) for f in capture.frames]
    assert seen == [(20, 21), (10, 11), (0, 1)]
    (folder / names.format("right", "cup")).unlink()
    assert "has no right image" in refused(_arguments(folder, "--out", str(tmp_path / "other")), capsys)


_START_MS = 1700000000123


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("ir_left_{ms}", "ir_right_{later}"),
        ("{ms}_ir1", "{later}_ir2"),
        ("left/infrared_{ms}", "right/infrared_{later}"),
        ("left_{s:.6f}", "right_{s:.6f}"),
        ("left_{ms}456", "right_{later}456"),
        ("left_{ms}456789", "right_{later}456789"),
    ],
)
def test_times_since_1970_in_names_are_taken_in_their_unit(recording, tmp_path, left, right):
    """One right image is lost: its left one is no frame, and gets no neighbour's."""
    for number in range(4):
        ms = _START_MS + 2000 * number
        for value, name in ((10 * number, left), (10 * number + 1, right)):
            file = tmp_path / "times" / f"{name.format(ms=ms, later=ms + 2, s=1e-3 * ms)}.png"
            file.parent.mkdir(parents=True, exist_ok=True)
            if value != 11:
                write_gray(file, np.full((48, 64), value, np.uint8))
    assert main(_arguments(tmp_path / "times")) == 0
    capture = read_capture(tmp_path / "capture")
    assert [capture.ir(f, "left")[0, 0] for f in capture.frames] == [0, 20, 30]
    assert [capture.ir(f, "right")[0, 0] for f in capture.frames] == [1, 21, 31]
    times_s = [1e-3 * (_START_MS + after_ms) for after_ms in (0, 4000, 6000)]
    assert [f.timestamp_s for f in capture.frames] == pytest.approx(times_s, abs=1e-3, rel=0)


@pytest.mark.parametrize("form", ["20260101_1200{}_{:06d}_{}", "{2}-12-00-{0}-{1:06d}", "202601011200{}{:06d}{}"])
def test_dates_in_names_order_frames_beyond_the_second(recording, tmp_path, form):
    folder = tmp_path / "dates"
    folder.mkdir()
    for number, (second, us) in enumerate((("00", 933000), ("00", 966000), ("01", 123), ("02", 33000))):
        for value, side in ((10 * number, "left"), (10 * number + 1, "right")):
            write_gray(folder / f"{form.format(second, us, side)}.png", np.full((48, 64), value, np.uint8))
    assert main(_arguments(folder)) == 0
    capture = read_capture(tmp_path / "capture")
    assert [capture.ir(f, "left")[0, 0] for f in capture.frames] == [0, 10, 20, 30]
    assert [capture.ir(f, "right")[0, 0] for f in capture.frames] == [1, 11, 21, 31]


def test_what_is_wrong_is_told_with_file_key_and_value(recording, tmp_path, capsys):
    def said(*more):
        line = refused(_arguments(recording, "--depth-scale", "0.001", *more), capsys)
        assert not [path for path in tmp_path.iterdir() if "capture" in path.name]
        return line

    assert "has 2 times for 3 frames: give one, or each" in said("--exposure", "0.01,0.02")
    for times, words in (("8.5", "milliseconds? Then give 0.0085"), ("0.01,33000", "microseconds? Then give 0.033")):
        assert words in run_here(capsys, *_arguments(recording, "--exposure", times)).stderr
    for scale, words in (("0", "above 0"), ("1", "millimetres have 0.001"), ("5000", "Then give 0.0002")):
        assert words in run_here(capsys, *_arguments(recording, "--depth-scale", scale)).stderr
    text = tmp_path / "d435.txt"
    for wrong, words in (
        (ENUMERATED.replace("Vector: -0.04", "Vector: 0.04"), "x is 0.0499586 m, expected below 0: left and right are"),
        (ENUMERATED.replace("Fx:         	43.0", "Fx:         	none"), "Fx is 'none', expected a number"),
        (ENUMERATED.replace("64x48", "32x24"), "none for the images' 64x48 (there are: 32x24)"),
        (ENUMERATED.split("Extrinsic Parameters")[0], "is missing: run rs-enumerate-devices -c"),
        ("no such thing", '"Intrinsic of": is nowhere in it'),
    ):
        text.write_text(wrong)
        assert words in said()
    text.write_text(ENUMERATED)
    odd = sorted(recording.glob("*Infrared 2*"))[1]
    write_gray(odd, np.zeros((24, 32), np.uint8))
    assert "is 32x24, expected 64x48" in said()
    odd.write_bytes(b"\x89PNG cut")
    assert odd.name in said()
    odd.unlink()
    write_gray(sorted(recording.glob("*Depth*"))[0], np.zeros((48, 64), np.uint8))
    assert "expected 16-bit depth" in said()
    for file in recording.glob("*Infrared 2*"):
        file.unlink()
    assert "Infrared 2: no PNG file" in said()


def test_depth_of_half_the_size_is_told_and_no_lead_names_what_is_no_depth(recording, capsys):
    for file in sorted(recording.glob("*Depth*")):
        write_gray(file, np.zeros((24, 32), np.uint16))
    line = refused(_arguments(recording), capsys)
    assert "is 32x24, the infrared images are 64x48" in line and "decimation filter" in line
    for file in sorted(recording.glob("*Depth*")):
        file.rename(file.with_name(file.name.replace("Depth", "small")))
        write_gray(file.with_name(file.name.replace("Depth", "sure")), np.zeros((48, 64), np.uint8))
    assert "--depth " not in run_here(capsys, *_arguments(recording)).stdout.replace("--depth WORD", "")


def test_an_inverse_extrinsic_will_do(tmp_path):
    text = tmp_path / "d435.txt"
    forwards = 'from "Infrared 1"	  To	  '
    text.write_text(ENUMERATED.replace(f'{forwards}"Infrared 2"', f'{forwards}"Color"'))
    assert read_device_text(text).extrinsic("Infrared 1", "Infrared 2")[0, 3] == pytest.approx(-0.0499585680663586)


def test_trajectories_are_checked(tmp_path):
    file = tmp_path / "poses.txt"
    for text, words in (
        ("0 0 0 0 0 0 0\n", "line 1: 7 numbers"), ("0 0 0 0 0 0 0 2\n", "line 1: the quaternion's length is 2"),
        ("# none\n", "holds no poses"),
        ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "line 2: timestamp 1.0* is not after"),
        ("0 0 0 nan 0 0 0 1\n", "line 1: 8 numbers, expected finite"),
    ):  # fmt: skip
        file.write_text(text)
        with pytest.raises(ValueError, match=words):
            read_trajectory(file)
    file.write_text("0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n")
    with pytest.raises(ValueError, match="outside the poses'"):
        pose_at(*read_trajectory(file), 2.0, "frame 7")
