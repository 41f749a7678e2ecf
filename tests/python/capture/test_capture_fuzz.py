# SPDX-License-Identifier: Apache-2.0
"""capture.json changed at random, under a seed: it is read, or one error names the file."""

import json
import random
import shutil
import warnings
from pathlib import Path
from typing import Any

import pytest

from activestereo.capture.capture import CaptureError, read_capture
from virtual_sensor.world import make_world

ODD = [
    None, True, -1, 0, 2**63, 1e308, -1e308, 0.5, "", "x", "../x.png", "/dev/zero", "a\nb", [], {}, [[]],
    [1e300] * 16, {"a": 1}, "\udcff",
]  # fmt: skip


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    world = make_world(tmp_path_factory.mktemp("world"), size=(32, 20), grid=1, bounces=0)
    return Path(shutil.copytree(world.capture_path, tmp_path_factory.mktemp("copy") / "capture"))


def places(value: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """(container, key) of every value inside."""
    for key in list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        found.append((value, key))
        places(value[key], found)
    return found


def test_changed_values(capture):
    text = (capture / "capture.json").read_text()
    dice = random.Random(1)
    refused = 0
    for _ in range(300):
        root = json.loads(text)
        for _ in range(dice.randint(1, 3)):
            container, key = dice.choice(places(root, []))
            if isinstance(container, dict) and dice.random() < 0.2:
                container.pop(key, None)
            else:
                container[key] = dice.choice(ODD)
        refused += not _reads(capture, json.dumps(root))
    assert refused > 100, "the changes reach nothing that is checked"


def test_changed_bytes(capture):
    text = (capture / "capture.json").read_text()
    dice = random.Random(2)
    for _ in range(200):
        characters = list(text)
        for _ in range(dice.randint(1, 4)):
            characters[dice.randrange(len(characters))] = dice.choice('{}[]",:0-9e.\\ \x00')
        if dice.random() < 0.2:
            del characters[dice.randrange(len(characters)) :]
        _reads(capture, "".join(characters))


def _reads(capture: Path, text: str) -> bool:
    (capture / "capture.json").write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            read_capture(capture)
        except CaptureError as error:
            assert "capture.json" in str(error)
            return False
    return True
