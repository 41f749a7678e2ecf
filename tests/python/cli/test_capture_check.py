# SPDX-License-Identifier: Apache-2.0
"""The command capture check: every fault of a capture is told in one run."""

import json
import shutil

import pytest

from activestereo.cli import main


@pytest.fixture
def capture(lab_world, tmp_path):
    """A copy of a good capture, to be spoiled."""
    folder = tmp_path / "world"
    shutil.copytree(lab_world.capture_path.parent, folder)
    return folder / lab_world.capture_path.name


def spoil(capture, change):
    path = capture / "capture.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


def check(capture, capsys):
    status = main(["capture", "check", str(capture), "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_a_good_capture(capture, capsys):
    assert check(capture, capsys) == (0, [])
    assert main(["capture", "check", str(capture)]) == 0 and "all is well" in capsys.readouterr().out


def test_all_faults_are_told_at_once(capture, capsys):
    def change(document):
        document["frames"][0] |= {"split": "maybe", "exposure_s": -1, "left": "none.png"}
        document["frames"][1]["gain"] = "high"
        del document["rig"]["left_to_right"]
        document["colour"] = 1

    spoil(capture, change)
    status, faults = check(capture, capsys)
    words = ("left_to_right: is missing", "split: is 'maybe'", "exposure_s", "none.png", "gain", "unknown key colour")
    assert status == 1 and len(faults) == len(words), faults
    for word in words:
        assert sum(word in fault for fault in faults) == 1, (word, faults)


@pytest.mark.parametrize(
    "spoilt, told", [(lambda old: old[:-200], "is damaged"), (lambda _: b"no image", "cannot be read as an image")]
)
def test_spoilt_images_are_told_each(capture, capsys, spoilt, told):
    frames = json.loads((capture / "capture.json").read_text())["frames"]
    for frame in frames[:2]:
        image = capture / frame["right"]
        image.write_bytes(spoilt(image.read_bytes()))
    status, faults = check(capture, capsys)
    assert status == 1 and len(faults) == 2 and all(told in fault for fault in faults), faults


def test_no_capture_and_another_format_are_one_fault(tmp_path, capsys):
    assert check(tmp_path, capsys)[0] == 1
    (tmp_path / "capture.json").write_text('{"format": "other"}')
    status, faults = check(tmp_path, capsys)
    assert status == 1 and len(faults) == 1 and "'other'" in faults[0]
