# SPDX-License-Identifier: Apache-2.0
"""Files and plug-ins of users that are no files, never end, or are changed at random."""

import argparse
import ctypes as c
import errno
import os
import platform
import random
import re
import struct
import subprocess
import warnings
from pathlib import Path
from typing import Any

import pytest
from activestereo.capture.capture import CaptureWarning
from activestereo.capture.capture_json import CaptureError
from activestereo.capture.images import read_gray
from activestereo.common.input_files import DEEPEST_JSON, MOST_TEXT_BYTES, read_json, read_text, read_toml
from activestereo.common.output_files import new_folder, write_text, written_together
from activestereo.effects.core import load as plugin
from activestereo.effects.core.load import load_plugin
from activestereo.report.view.library import Library
from command_line import run_here
from PIL import Image

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


def test_a_read_only_disk_is_told_with_the_files_own_name(tmp_path, monkeypatch):
    def refuse(path, *rest, **more):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr("activestereo.common.output_files.open", refuse, raising=False)
    monkeypatch.setattr(Path, "unlink", refuse)
    with pytest.raises(OSError) as caught:
        write_text(tmp_path / "model.json", "{}")
    assert caught.value.filename == str(tmp_path / "model.json")


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


def one_line(result: subprocess.CompletedProcess, status: int = 2) -> str:
    assert result.returncode == status, result.stderr
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1 and "Traceback" not in result.stderr, result.stderr
    return lines[0]


def npy_header(shape: str) -> bytes:
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


@pytest.mark.parametrize(
    "shape", ["(99999999, 99999999)", "(4, 5)", "(-1, 5)", "(99999999999999999999, 2)", "()", "(3,)"]
)
def test_an_array_file_that_promises_more_than_it_holds(run, tmp_path, shape):
    (tmp_path / "stack.npy").write_bytes(npy_header(shape) + b"\0" * 8)
    assert "stack.npy" in one_line(run("calibrate", "noise", tmp_path / "stack.npy", "-o", tmp_path / "model.json"))


PARAMETERS = '{"ranking": [{"effect": "read_noise", "parameters": 4}]}'


@pytest.mark.parametrize("text", ['{"ranking": 1}', '{"model": 3}', '{"ranking": [3]}', PARAMETERS, "[]", "{", "7"])
def test_parameters_from_a_file_that_is_no_diagnosis(run, tmp_path, text):
    (tmp_path / "other.json").write_text(text)
    one_line(run("add", "read_noise", "--from", tmp_path / "other.json", "-o", tmp_path / "model.json"))
    assert not (tmp_path / "model.json").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("compare MODEL -o out", "model.json: is a file; a capture is a folder"),
        (
            "compare CAPTURE --model CAPTURE/capture.json -o out",
            "expected 'active-stereo-model'; a model is a model.json",
        ),
        ("compare CAPTURE --model CAPTURE/pattern.png -o out", "is no text in UTF-8: .*; a model is a model.json"),
        ("compare CAPTURE --model CAPTURE -o out", "Is a directory.; a model is a model.json"),
        ("diagnose CAPTURE --effects MODEL -o out", "--model takes a model.json"),
        ("add vignetting --from MODEL -o out", "model.json: not a diagnose.json: it has no ranking"),
        ("add vignetting --from CAPTURE -o out", "diagnose.json: No such file"),
        ("calibrate noise CAPTURE -o CAPTURE/pattern.png", "give another file to -o"),
        ("depth PICTURE PICTURE --calibration MODEL -o out", "image_width: is missing: ROS' camera_info"),
    ],
)
def test_a_file_of_another_kind_is_told_with_the_kind_that_is_asked_for(run, lab_world, tmp_path, arguments, said):
    model, capture = tmp_path / "model.json", lab_world.capture_path
    model.write_text('{"format": "active-stereo-model", "version": 2, "effects": []}')
    names = {"CAPTURE": str(capture), "MODEL": str(model), "PICTURE": str(capture / "left" / "000000.png")}
    words = re.sub("|".join(names), lambda name: names[name.group()], arguments).split()
    result = run(*words[:-1], tmp_path / words[-1])
    assert result.returncode == 2 and re.search(said, result.stderr), result.stderr


def test_a_captures_file_is_viewed_as_its_capture(lab_world):
    assert Library(lab_world.capture_path / "capture.json", lambda path: path).names


def test_help_into_a_closed_pipe(build):
    command = f"'{build}/bin/activestereo' --help | true"
    result = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, timeout=60)
    assert "Traceback" not in result.stderr and "Exception ignored" not in result.stderr


@pytest.mark.parametrize(
    "raised, said",
    [
        (IndexError("list index\nout of range"), "a fault of the program (IndexError in "),
        (MemoryError(), "out of memory"),
        (ModuleNotFoundError("no cv2", name="cv2"), 'pip install "activestereo[lab]"'),
        (ModuleNotFoundError("no kuafu._kuafu", name="kuafu._kuafu"), "bash examples/quickstart.sh"),
    ],
)
def test_what_nobody_foresaw_and_a_missing_package_are_one_line(monkeypatch, capsys, raised, said):
    from activestereo import cli

    def broken(_: object) -> None:
        raise raised

    monkeypatch.setattr(cli, "_parsed", lambda _: argparse.Namespace(run=broken, allow_outside=False))
    assert cli.main(["presets"]) == 3
    text = capsys.readouterr().err
    assert text.count("\n") == 1 and said in text


def test_a_warning_is_a_line_as_an_error_is(monkeypatch, run):
    def warn(_: object) -> None:
        for _ in range(2):
            warnings.warn("key colour is ignored", CaptureWarning, stacklevel=1)

    monkeypatch.setattr("activestereo.cli.presets.run", warn)
    assert run("presets").stderr == "activestereo: key colour is ignored\n"


@pytest.mark.parametrize("arguments", [["effect", "check", "a\nb"], ["doctor", "a\nb"], ["a\nb"]])
def test_a_name_of_two_lines_is_told_in_one(run, arguments):
    assert r"a\nb" in one_line(run(*arguments))


def test_a_name_that_is_no_utf8_is_told(build, tmp_path):
    command = [build / "bin" / "activestereo", "compare", tmp_path / "\udcff", "-o", tmp_path / "out"]
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    result = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
    assert r"\udcff" in one_line(result)


LIBRARY = """
#include <stdint.h>
const void* table;
uint32_t count;
const void* ks_effect_plugin(uint32_t* out) { return *out = count, table; }
"""
TEXTS = [b"a", b"effect", b"", None, b"\xff\xfe", b"lambda", b"two words", b"a\nb", b"x" * 5000, "\u00e4".encode()]
NUMBERS = [0.0, 1.0, -1.0, 0.5, float("nan"), float("inf"), -float("inf"), 1e308, 5e-324]
COUNTS = [0, 1, 2, 3, 65, 2**31, 2**32 - 1]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plugin")
    (folder / "table.c").write_text(LIBRARY)
    subprocess.run(["cc", "-shared", "-fPIC", folder / "table.c", "-o", folder / "table.so"], check=True)
    return folder / "table.so"


def record(dice: random.Random, count: int, terms: Any) -> plugin.records.Effect:
    """A sound effect."""
    parameters = (plugin.records.Parameter * 3)(
        *(plugin.records.Parameter(n, b"1", b"", 0.0, 0.0, 1.0, 0.5) for n in (b"p", b"q", b"r"))
    )
    header = plugin.records.Header(c.sizeof(plugin.records.Effect), plugin.records.TYPE_EFFECT)
    apply = plugin.records.Apply(lambda *_: 0)
    texts = (b"effect", b"f", b"s", b"s")
    return plugin.records.Effect(header, *texts, 7, dice.randrange(3), count, 1, parameters, apply, terms)


def disturb(dice: random.Random, struct: Any) -> None:
    """Another value in one of the struct's fields."""
    name, kind = dice.choice([field[:2] for field in struct._fields_])
    if kind is c.c_char_p:
        setattr(struct, name, dice.choice(TEXTS))
    elif kind is c.c_double:
        setattr(struct, name, dice.choice(NUMBERS))
    elif kind is c.c_uint32:
        setattr(struct, name, dice.choice(COUNTS))
    elif kind is plugin.records.Header:
        setattr(getattr(struct, name), dice.choice(["type", "size_bytes"]), dice.choice(COUNTS))
    else:
        setattr(struct, name, kind())  # NULL


def test_changed_tables(library: Path) -> None:
    dice = random.Random(1)
    own = c.CDLL(str(library))
    outcomes = {"read": 0, "refused": 0}
    for _ in range(3000):
        term = plugin.records.RandomTerm(b"p", None, 0, 0)
        count = dice.randrange(1, 4)
        effects = (plugin.records.Effect * 3)(*(record(dice, count, c.pointer(term)) for _ in range(3)))
        for _ in range(dice.randrange(3)):
            first = effects[0]
            disturb(dice, dice.choice([first, first, term, first.parameters[0]]) if first.parameters else first)
        if effects[0].random_terms and 1 < effects[0].random_term_count <= 64:
            effects[0].random_term_count = 1  # more than there are, C cannot tell
        if effects[0].parameters and 3 < effects[0].parameter_count <= 64:
            effects[0].parameter_count = 3
        c.c_void_p.in_dll(own, "table").value = dice.choice([c.addressof(effects)] * 9 + [None])
        c.c_uint32.in_dll(own, "count").value = dice.choice([1, 1, 1, 1, 3, 0, 257, 2**32 - 1])
        try:
            assert load_plugin(library)
            outcomes["read"] += 1
        except ValueError as error:
            assert str(error).startswith(f"{library}: ") and "\n" not in str(error) and len(str(error)) < 6000, error
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 300, outcomes
