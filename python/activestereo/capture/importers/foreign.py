# SPDX-License-Identifier: Apache-2.0
"""Files that people take for calibrations or poses of an infrared pair, by the names that their makers give them."""

from __future__ import annotations

from pathlib import Path

from activestereo.common.input_files import read_json_object

_TRANSFORMS = "transforms.json"


def refuse_foreign(path: Path) -> None:
    """Raises ValueError if a file, or a folder's transforms.json, is of a known kind that is not supported."""
    path = path / _TRANSFORMS if path.is_dir() else path
    if path.suffix.lower() != ".json" or not path.is_file():
        return
    frames = read_json_object(path).get("frames")
    if isinstance(frames, list) and any(isinstance(frame, dict) and "transform_matrix" in frame for frame in frames):
        raise ValueError(
            f"{path}: is nerfstudio's transforms.json (instant-ngp's, too): lens and poses of one colour camera, no "
            "infrared pair: give a recording with left and right images, and --calibration of both cameras"
        )
