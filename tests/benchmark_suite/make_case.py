# SPDX-License-Identifier: Apache-2.0
"""Makes one case of the benchmark suite: the capture, and its answer key in another place."""

import json
import shutil

from suite_sets import STRENGTHS
from virtual_sensor.held_out import oracle
from virtual_sensor.held_out.case import Case
from virtual_sensor.held_out.mitsuba_case import MitsubaCase


def make_case(item, capture_folder, key_path, scene_errors, more=None, elsewhere=None):
    """Writes the capture and the answer key of an Item, whole or not at all, and returns the key.

    scene_errors: size of the errors in the believed scene, 1 = usual. more: a change of frames recorded beside the
    usual ones (see more.py). elsewhere: (folder, seed) for a capture of another scene by the same sensor.
    """
    hidden, moving_exposure = item.draw()
    kind = MitsubaCase if item.set == "mitsuba" else Case
    case = kind(item.seed, hidden, scene_errors, moving_exposure=moving_exposure, more=more)
    figures = _write(case, capture_folder, item)
    if elsewhere is not None:
        folder, seed = elsewhere
        _write(case.in_scene(seed), folder, item)
    key = {
        "id": item.id,
        "set": item.set,
        "name": item.anonymous_name,
        "infrared": item.infrared,
        "scene_errors": scene_errors,
        "strengths": {name: STRENGTHS[index] for name, index in item.strengths},
        "hidden": hidden,
        "scored": oracle.scored_parameters(case),
        "oracle": figures,
    }
    key_path.parent.mkdir(parents=True, exist_ok=True)
    part = key_path.with_suffix(".part")
    part.write_text(json.dumps(key, indent=1))
    part.rename(key_path)
    return key


def _write(case, folder, item):
    building = folder.with_name(folder.name + ".part")
    shutil.rmtree(building, ignore_errors=True)
    figures = case.capture(building, item.anonymous_name)
    if not item.infrared:
        _leave_out_infrared(building)
    shutil.rmtree(folder, ignore_errors=True)
    building.rename(folder)
    return figures


def _leave_out_infrared(folder):
    document = json.loads((folder / "capture.json").read_text())
    for frame in document["frames"]:
        del frame["left"], frame["right"]
    (folder / "capture.json").write_text(json.dumps(document, indent=1))
    for side in ("left", "right"):
        shutil.rmtree(folder / side)
