# SPDX-License-Identifier: Apache-2.0
"""A file of a user's may be a pipe, a device, huge or nested without end: one line says so, at once."""

import os
import platform

import pytest
from PIL import Image

from activestereo.capture.capture import read_capture
from activestereo.capture.capture_json import CaptureError
from activestereo.capture.images import read_gray
from activestereo.common.input_files import DEEPEST_JSON, MOST_TEXT_BYTES, read_json, read_text, read_toml
from activestereo.common.output_files import new_folder, write_text, written_together
from command_line import run_here

# Commands whose words FILE, and OUT for a file to write, are replaced.
READ = [
    "generate CAPTURE/scene.gltf --out NEW --ranges FILE",
    "compare CAPTURE --out NEW --model FILE",
    "diagnose CAPTURE --out NEW --model FILE",
    "model show FILE",
    "add vignetting --from FILE -o NEW",
    "add vignetting --model FILE -o NEW",
    "benchmark sim-to-real FILE",
    "calibrate noise FILE -o NEW",
    "depth FILE FILE --k 400,400,320,240 --baseline 0.05 --out NEW",
    "simulate FILE --out NEW",
    "simulate scene.gltf --out NEW --sensor FILE",
]


@pytest.fixture(scope="module")
def fifo(tmp_path_factory):
    path = tmp_path_factory.mktemp("pipe") / "model.json"
    os.mkfifo(path)
    return path


def ended(capsys, words, lab_world, file, new):
    words = words.replace("FILE", str(file)).replace("CAPTURE", str(lab_world.capture_path)).replace("NEW", str(new))
    return run_here(capsys, *words.split())


@pytest.mark.parametrize("words", READ)
def test_a_pipe_is_refused_at_once(words, lab_world, fifo, tmp_path, capsys):
    result = ended(capsys, words, lab_world, fifo, tmp_path / "new.json")
    assert result.returncode == 2, result.stderr
    assert str(fifo) in result.stderr and "Traceback" not in result.stderr


@pytest.mark.parametrize("words", [words for words in READ if "depth" not in words])
def test_brackets_without_end_are_told_with_the_file(words, lab_world, tmp_path, capsys):
    path = tmp_path / "deep.json"
    path.write_text("[" * 100_000 + "]" * 100_000)
    result = ended(capsys, words, lab_world, path, tmp_path / "new.json")
    assert result.returncode == 2 and str(path) in result.stderr
    assert "recursion" not in result.stderr and "Traceback" not in result.stderr


@pytest.mark.parametrize("target", ["/dev/full", "FIFO", "LOOP"])
def test_a_target_that_is_no_file_is_refused_before_the_work(target, fifo, tmp_path, capsys):
    loop = tmp_path / "loop.json"
    loop.symlink_to(loop)
    path = {"FIFO": fifo, "LOOP": loop}.get(target, target)
    frames = tmp_path / "no_frames_are_looked_at"
    result = run_here(capsys, "calibrate", "noise", frames, "-o", path)
    assert result.returncode == 2 and str(path) in result.stderr and str(frames) not in result.stderr
    assert os.path.lexists(path) and (target != "LOOP" or loop.is_symlink())


def test_a_captures_file_that_is_a_pipe_is_a_capture_error(tmp_path):
    os.mkfifo(tmp_path / "capture.json")
    with pytest.raises(CaptureError, match="capture.json: cannot be read .*pipe or a device"):
        read_capture(tmp_path)


def test_a_text_larger_than_any_is_not_read(tmp_path):
    path = tmp_path / "large.json"
    with open(path, "wb") as file:
        file.truncate(MOST_TEXT_BYTES + 1)
    with pytest.raises(OSError, match="at most 67 MB"):
        read_text(path)
    with pytest.raises(OSError, match="pipe or a device"):
        read_text("/dev/zero")


def test_json_may_nest_as_deep_as_the_limit(tmp_path):
    for depth in (DEEPEST_JSON, DEEPEST_JSON + 1):
        (tmp_path / f"{depth}.json").write_text("[" * depth + "]" * depth)
    assert read_json(tmp_path / f"{DEEPEST_JSON}.json")
    with pytest.raises(ValueError, match="101.json: its brackets are nested deeper than 100"):
        read_json(tmp_path / f"{DEEPEST_JSON + 1}.json")


@pytest.mark.parametrize(
    "text",
    ["a=" + "[" * 100_000, "a=" + "{a=" * 50_000, ".".join(["a"] * 100_000) + "=1", "\0", "a = '\xff'"],
    ids=["brackets", "tables", "parts", "zero", "latin"],
)
def test_toml_that_nests_without_end_is_refused(text, tmp_path):
    (tmp_path / "a.toml").write_bytes(text.encode("latin-1"))
    with pytest.raises(ValueError, match="a.toml: (its brackets|a key has|is no TOML)"):
        read_toml(tmp_path / "a.toml")


def test_a_new_folder_is_whole_or_not_there(tmp_path):
    with pytest.raises(OSError) as caught, new_folder(tmp_path / "capture") as folder:
        write_text(folder / "a.txt", "a")
        raise OSError(28, "No space left on device", str(folder / "b.png"))
    assert caught.value.filename == str(tmp_path / "capture/b.png") and not list(tmp_path.iterdir())
    with new_folder(tmp_path / "capture") as folder:
        write_text(folder / "a.txt", "a")
    assert [path.name for path in tmp_path.iterdir()] == ["capture"]
    with new_folder(tmp_path / "not/there/yet"):
        pass
    assert (tmp_path / "not/there/yet").is_dir() and len(list((tmp_path / "not/there").iterdir())) == 1
    with pytest.raises(FileExistsError, match="exists already"), new_folder(tmp_path / "capture"):
        pass


def test_files_that_cannot_all_move_leave_what_was_there(tmp_path):
    (tmp_path / "a.txt").write_text("before")
    (tmp_path / "b.txt").mkdir()
    with pytest.raises(OSError, match="no regular file"), written_together(tmp_path) as aside:
        write_text(aside / "a.txt", "after")
        write_text(aside / "b.txt", "after")
    assert (tmp_path / "a.txt").read_text() == "before" and len(list(tmp_path.iterdir())) == 2


def test_what_a_killed_process_left_goes_with_the_next_write(tmp_path):
    left = tmp_path / f".unfinished-process_{platform.node()}_999999999-x"  # no system has such a process
    own = tmp_path / f".unfinished-process_{platform.node()}_{os.getpid()}-x"
    elsewhere = tmp_path / ".unfinished-process_another-machine_999999999-x"
    for folder in (left, own, elsewhere):
        folder.mkdir()
    with written_together(tmp_path) as aside:
        write_text(aside / "a.txt", "a")
    assert {path.name for path in tmp_path.iterdir()} == {"a.txt", own.name, elsewhere.name}


def test_an_image_that_is_larger_than_any_cameras_is_refused_with_its_name(tmp_path):
    Image.new("L", (8193, 8192)).save(tmp_path / "a.png")
    with pytest.raises(CaptureError, match="a.png: image: is 8193x8192, at most 67108864 pixels"):
        read_gray(tmp_path / "a.png", key="image")


def test_an_interrupt_between_two_files_leaves_what_was_there(tmp_path, monkeypatch):
    for name in "ab":
        (tmp_path / name).write_text("before")
    replace, interrupts = os.replace, [KeyboardInterrupt]

    def interrupted(source, place):
        if str(place) == str(tmp_path / "b") and interrupts:
            raise interrupts.pop()
        replace(source, place)

    monkeypatch.setattr("activestereo.common.output_files.os.replace", interrupted)
    with pytest.raises(KeyboardInterrupt), written_together(tmp_path) as aside:
        for name in "ab":
            (aside / name).write_text("after")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "before", "b": "before"}
