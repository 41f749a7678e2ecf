# SPDX-License-Identifier: Apache-2.0
"""Files, pictures and lines that a program leaves."""

import errno
import io
import os
import warnings
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
from activestereo.cli import main
from activestereo.common.accuracy import accuracy_by_material, accuracy_table
from activestereo.common.output_files import replace_file, write_depth_png, write_ply, write_png, write_text
from activestereo.common.phases import Phases
from activestereo.common.progress_bar import ProgressBar, duration
from activestereo.common.shown import PlainStream, printable, two_digits, unknown
from activestereo.report.pictures import simulation_figure
from PIL import Image


def test_a_failed_write_leaves_the_old_file_and_threads_that_write_one_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")

    def fail(file: BinaryIO) -> None:
        file.write(b"half")
        raise OSError("disk full")

    with pytest.raises(OSError):
        replace_file(path, fail)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]

    def write_again(file: BinaryIO) -> None:
        replace_file(path, lambda inner: inner.write(b"inner"))
        file.write(b"outer")

    replace_file(path, write_again)  # as a second thread would, in the middle of the first
    assert path.read_bytes() == b"outer" and list(tmp_path.iterdir()) == [path]


def test_long_names_are_written_and_cut_in_messages(tmp_path: Path) -> None:
    path = tmp_path / (240 * "a")
    write_text(path, "x")
    assert list(tmp_path.iterdir()) == [path]
    assert len(unknown("effect", 100_000 * "x", 10 * ["xylophone"])) < 250


def test_a_full_disk_is_named(tmp_path: Path) -> None:
    """/dev/full has no room, and what is written there does not say where it should have gone."""

    def fill(file: BinaryIO) -> None:
        with open("/dev/full", "wb", buffering=0) as full:
            full.write(b"x")

    path = tmp_path / "depth.png"
    with pytest.raises(OSError, match="No space left") as raised:
        replace_file(path, fill)
    assert raised.value.errno == errno.ENOSPC and raised.value.filename == str(path)
    assert not list(tmp_path.iterdir())

    def cut(file: BinaryIO) -> None:
        raise OSError("100 requested and 0 written")  # as numpy.save says it

    with pytest.raises(OSError, match="No space left on device: 100 requested") as raised:
        replace_file(path, cut)
    assert raised.value.filename == str(path)


def test_depth_png_is_millimetres(tmp_path):
    write_depth_png(tmp_path / "d.png", np.array([[0.0, 0.5004, 1.2346], [70.0, np.nan, 65.535]], np.float32))
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "d.png")), [[0, 500, 1235], [65535, 0, 65535]])


@pytest.mark.parametrize("colors", [None, np.array([[1.0, 0.5, 0.0], [0.0, 0.0, 1.0]])])
def test_ply_holds_the_points(tmp_path, colors):
    points = np.array([[1, 2, 3], [4, 5, 6]], np.float32)
    write_ply(tmp_path / "p.ply", points, colors)
    header, body = (tmp_path / "p.ply").read_bytes().split(b"end_header\n")
    assert b"element vertex 2" in header
    record = 12 if colors is None else 15
    assert len(body) == 2 * record
    np.testing.assert_array_equal(np.frombuffer(body[record : record + 12], "<f4"), points[1])
    if colors is not None:
        assert list(body[12:15]) == [255, 128, 0]


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_bar_tells_the_time_left_and_is_sparing_where_there_is_no_terminal():
    clock, stream = Clock(), Terminal()
    with ProgressBar("work", stream, clock=clock) as bar:
        clock.now = 10.0
        bar(0.25)
        assert "25 %" in stream.getvalue() and "30 s left" in stream.getvalue()
        before = stream.getvalue()
        clock.now = 10.01
        bar(0.26)
        assert stream.getvalue() == before  # not redrawn that soon
        clock.now = 40.0
    assert stream.getvalue().endswith("done in 40 s\n")
    clock, stream = Clock(), io.StringIO()
    with ProgressBar("work", stream, clock=clock) as bar:
        for step in range(100):
            clock.now += 0.4
            bar(step / 100)
    assert 2 <= len(stream.getvalue().splitlines()) <= 4 and "\r" not in stream.getvalue()


@pytest.mark.parametrize(
    "seconds, text", [(0.44, "0.4 s"), (12.3, "12 s"), (59.8, "1 min 00 s"), (185, "3 min 05 s"), (3725, "1 h 02 min")]
)
def test_duration(seconds, text):
    assert duration(seconds) == text


def test_accuracy_by_material():
    true = np.full((10, 20), 1.0)
    true[:, 19] = 0.0  # nothing there
    ids = np.zeros((10, 20), np.uint32)
    ids[:, 10:] = 1
    measured = true + 0.002
    measured[:5, 10:] = 0.0
    measured[5:, 10:] = 1.02
    found = accuracy_by_material(measured, true, ids, lambda i: ["good", "bad"][i], least_pixels=10)
    rows = {row.name: row for row in found}
    for name, pixels, fill, error_m in (("good", 100, 1.0, 0.002), ("bad", 90, 0.5, 0.02)):
        row = rows[name]
        assert (row.pixels, row.fill) == (pixels, fill) and row.median_error_m == pytest.approx(error_m)
    assert rows["all"].pixels == 190 and rows["all"].invented == 0.0
    assert "good" in accuracy_table(list(rows.values()))


def test_depth_from_nothing_and_a_material_never_measured_are_told():
    true = np.full((10, 20), 1.0)
    true[:, 10:] = 0.0
    measured = true.copy()
    measured[:2, 10:] = 3.0  # nothing there
    measured[:3, :10] = 1.06
    rows = accuracy_by_material(measured, true, np.zeros((10, 20), np.uint32), lambda i: "box")
    assert [row.name for row in rows] == ["box", "nothing there", "all"]
    assert [row.invented for row in rows] == pytest.approx([0.3, 0.2, 0.3])
    assert "20.0 %" in accuracy_table(rows).splitlines()[2]
    row = accuracy_by_material(np.zeros((10, 10)), np.ones((10, 10)), np.zeros((10, 10), int), lambda i: "dark")[0]
    assert row.fill == 0.0 and np.isnan(row.median_error_m) and "dark" in accuracy_table([row])


def test_a_picture_of_nothing_says_so():
    nothing, ids = np.zeros((32, 32), np.float32), np.zeros((32, 32), np.uint32)
    rgb, ir = np.zeros((32, 32, 3), np.float32), [np.zeros((32, 32), np.uint8)] * 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for true, words in ((nothing, "nothing is in"), (nothing + 1.0, "no pixel measured")):
            rows = accuracy_by_material(nothing, true, ids, lambda i: "dark")
            assert "nan" not in accuracy_table(rows)
            figure = simulation_figure("nothing", rgb, ir, nothing, true, rows)
            assert any(words in text.get_text() for text in figure.texts)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_png_has_the_pixels_that_were_written(tmp_path, kind):
    random = np.random.default_rng(0)
    for shape in ((1, 1), (48, 64), (48, 64, 3))[: 3 if kind is np.uint8 else 2]:
        pixels = random.integers(0, np.iinfo(kind).max, shape, kind, endpoint=True)
        for image in (pixels, pixels[::-1], np.zeros_like(pixels)):
            write_png(tmp_path / "p.png", image)
            np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "p.png")), image)


def test_what_is_no_file_is_not_replaced(tmp_path):
    pipe, loop, folder = tmp_path / "pipe", tmp_path / "loop", tmp_path / "folder"
    os.mkfifo(pipe)
    loop.symlink_to(loop)
    folder.mkdir()
    for target in (pipe, loop, folder, Path("/dev/null")):
        with pytest.raises(OSError) as raised:
            write_text(target, "x")
        assert raised.value.filename == str(target)
    assert pipe.is_fifo() and loop.is_symlink() and folder.is_dir() and Path("/dev/null").is_char_device()
    assert len(list(tmp_path.iterdir())) == 3


NAMES = {"\x1b[31mred": "\\x1b[31mred", "bell\x07": "bell\\x07", "two\nlines": "two\\nlines", "\x9bm": "\\x9bm",
         "\ud800": "\\ud800", "\u202eright": "\\u202eright", "\r over": "\\r over", "日本": "日本"}  # fmt: skip


@pytest.mark.parametrize(("name", "shown"), NAMES.items())
def test_a_name_is_shown_with_escapes(name: str, shown: str) -> None:
    assert printable(name) == printable(Path(name)) == shown
    stream, bar = io.StringIO(), io.StringIO()
    print(f"a\tb {name}", file=PlainStream(stream))
    assert stream.getvalue() == f"a\tb {name if name == 'two' + chr(10) + 'lines' else shown}\n"
    with ProgressBar(name, bar):
        pass
    assert bar.getvalue().startswith(f"{shown}: 100 %") and bar.getvalue().count("\n") == 1


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("日本", "\ud800")])
def test_a_command_prints_no_raw_name(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / name
    (folder / "left").mkdir(parents=True)
    assert main(["compare", str(folder), "-o", str(tmp_path / "out")]) == 2
    assert main(["add", "haze", "-o", str(folder / "model.json")]) == 0
    out, err = capfd.readouterr()
    assert name not in out + err and printable(name) in out and printable(name) in err + out


USUAL_S = {"render": 10.0, "fit": 30.0, "write": 20.0}


@pytest.mark.parametrize("slow", [{}, {"render": 0.1}, {"fit": 90.0}, {"write": 60.0}])
def test_a_run_is_told_by_its_phases_shares(slow):
    clock, told = Clock(), []
    phases = Phases(told.append, USUAL_S, clock=clock)
    for name, seconds in (USUAL_S | slow).items():
        phases.begin(name)
        for i in range(1, 11):
            clock.now += seconds / 10
            phases(i / 10)
    phases.end()
    assert phases.taken_s == pytest.approx(USUAL_S | slow)
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)
    assert told[10] == pytest.approx(10 / 60) and told[21] == pytest.approx(40 / 60)


def test_the_bar_names_the_phase_and_its_number():
    stream, clock = io.StringIO(), Clock()
    with ProgressBar("work", stream, clock=clock) as bar:
        phases = Phases(bar, USUAL_S, clock=clock)
        phases.begin("render")
        clock.now += 20.0
        phases.begin("fit")
        clock.now += 30.0
        phases(0.5)
        phases.end()
    assert stream.getvalue().splitlines() == [
        "work: render 1/3, 0 %, ...",
        "work: fit 2/3, 17 %, 1 min 40 s left",
        "work: fit 2/3, 42 %, 1 min 10 s left",
        "work: 100 %, done in 50 s",
    ]
    told = []
    phases = Phases(told.append, USUAL_S)
    phases.begin("render")
    for fraction in (0.5, 1.0, 0.01, 0.5, 1.0):  # a second pass does not begin it again
        phases(fraction)
    assert told == sorted(told)


def test_numbers_have_two_digits_and_no_exponent():
    assert [two_digits(x) for x in (0.8571, 99.6, 121.4, 5380.0)] == ["0.86", "100", "120", "5400"]
