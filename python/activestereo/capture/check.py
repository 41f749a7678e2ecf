# SPDX-License-Identifier: Apache-2.0
"""Finds everything that is wrong with a capture in one pass; read_capture() ends at the first fault."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from activestereo.capture.capture import SIDES, capture_from
from activestereo.capture.capture_json import CaptureError, JsonObject


def capture_faults(path: str | Path) -> list[str]:
    """Returns all faults of a capture's JSON, in its order; if there are none, those of its images. Empty if the
    capture is right."""
    folder, faults = Path(path).parent if Path(path).name == "capture.json" else Path(path), list[str]()
    try:
        root = JsonObject.read(folder / "capture.json", faults)
        capture = capture_from(root)
    except CaptureError as error:  # no file, or another format or version: its keys have unknown meanings
        return list(dict.fromkeys([*faults, str(error)]))
    faults += [f"{root.path}: unknown key {key} is ignored" for key in root.unknown_keys()]
    if faults:
        return list(dict.fromkeys(faults))
    # The file is right: decode each image.
    reads: list[Callable[[], object]] = [capture.rig.projector.pattern]
    for frame in capture.frames:
        reads += [partial(capture.ir, frame, side) for side in SIDES if frame.has_infrared]
        reads += [partial(capture.depth, frame), partial(capture.color, frame)]
    for read in reads:
        try:
            read()
        except CaptureError as error:
            faults.append(str(error))
    return faults
