# SPDX-License-Identifier: Apache-2.0
"""Writes captures (capture format, version 1), for programs that record or simulate them."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.capture.capture import FORMAT, SIDES, VERSION, Capture, Uncertainty
from activestereo.capture.images import write_gray
from activestereo.common.input_files import read_bytes
from activestereo.common.output_files import flat, new_folder, write_bytes, write_json, write_png, write_text

# Fields of Frame that have the same name in capture.json.
_FRAME_FIELDS = (
    "gripper_to_base", "timestamp_s", "exposure_s", "gain", "projector_power", "ambient", "temperature_c",
    "camera_to_world", "camera_velocity", "repeat_group", "split",
)  # fmt: skip
_EMPTY_SCENE = '{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}\n'


def write_capture(
    path: str | Path, capture: Capture, images: Mapping[tuple[int, str], np.ndarray], pattern: np.ndarray,
    depths: Mapping[int, np.ndarray] | None = None, colors: Mapping[int, np.ndarray] | None = None,
    masks: Mapping[tuple[int, str], np.ndarray] | None = None, with_empty_scene: bool = False,
) -> None:  # fmt: skip
    """Writes `capture` as a folder at `path`, which must not exist; it is made in a sibling folder and then renamed.

    images: {(frame id, side): uint8 or uint16 [height, width]}, empty for recordings of colour and depth alone;
    pattern: uint8 [height, width]; depths: {frame id: uint16 [height, width]} in units of the frame's depth_scale;
    colors: {frame id: sRGB uint8 [height, width, 3]}; masks: {(frame id, side): bool [height, width]}, true where the
    scene is known. capture.scene_path is copied with every file beside it that has the same stem; with_empty_scene
    writes a scene without objects under its name instead."""
    with new_folder(Path(path)) as out:
        for name in ("left", "right", "depth", *(("color",) if colors else ())):
            (out / name).mkdir(parents=True, exist_ok=True)
        if with_empty_scene:
            write_text(out / capture.scene_path.name, _EMPTY_SCENE)
        else:
            for source in capture.scene_path.parent.glob(capture.scene_path.stem + ".*"):
                if source.is_file():
                    write_bytes(out / source.name, read_bytes(source))
        write_gray(out / "pattern.png", pattern)
        for (frame_id, side), image in images.items():
            write_gray(out / side / f"{frame_id:06d}.png", image)
        for frame_id, image in (depths or {}).items():
            write_gray(out / "depth" / f"{frame_id:06d}.png", image)
        for frame_id, image in (colors or {}).items():
            write_png(out / "color" / f"{frame_id:06d}.png", image)
        for (frame_id, side), known in (masks or {}).items():
            (out / "mask" / side).mkdir(parents=True, exist_ok=True)
            write_gray(out / "mask" / side / f"{frame_id:06d}.png", known.astype(np.uint8) * 255)
        root = _capture_json(capture)
        root["frames"] = []
        for frame in capture.frames:
            name = f"{frame.id:06d}.png"
            entry: dict[str, Any] = {"id": frame.id}
            entry |= {side: f"{side}/{name}" for side in SIDES if (frame.id, side) in images}
            if frame.id in (depths or {}):
                entry |= {"depth": f"depth/{name}", "depth_scale": frame.depth_scale}
            if frame.id in (colors or {}):
                entry["color"] = f"color/{name}"
            entry |= {f"{side}_mask": f"mask/{side}/{name}" for side in SIDES if (frame.id, side) in (masks or {})}
            for key in _FRAME_FIELDS:
                value = getattr(frame, key)
                if value is not None or key != "gripper_to_base":
                    entry[key] = flat(value) if np.ndim(value) else value
            root["frames"].append(entry)
        write_json(out / "capture.json", root)


def _capture_json(capture: Capture) -> dict[str, Any]:
    """Returns the content of capture.json without its frames."""
    rig = capture.rig
    root: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "name": capture.name,
        "scene": capture.scene_path.name,
        "rig": {
            "left": rig.left.as_json(),
            "right": rig.right.as_json(),
            "left_to_right": flat(rig.left_to_right),
            "projector": {
                "pattern": "pattern.png",
                "K": flat(rig.projector.K),
                "left_to_projector": flat(rig.projector.left_to_projector),
            },
            "bit_depth": rig.bit_depth,
            "readout": {"line_time_s": rig.line_time_s},
        },
        "depth_engine": capture.depth_engine,
    }
    if rig.color is not None:
        root["rig"]["color"] = rig.color.as_json() | {"left_to_color": flat(rig.color.left_to_color)}
    if rig.black_dn is not None:
        root["rig"]["black_dn"] = list(rig.black_dn)
    if capture.lights:
        root["lights"] = [
            {"name": light.name, "position_m": flat(light.position_m), "radius_m": light.radius_m}
            for light in capture.lights
        ]
    if capture.measured:
        root["measured"] = capture.measured
    if capture.uncertainty != Uncertainty():
        root["uncertainty"] = asdict(capture.uncertainty)
    return root
