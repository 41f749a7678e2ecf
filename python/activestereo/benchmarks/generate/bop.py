# SPDX-License-Identifier: Apache-2.0
"""Writes and reads the files of the BOP format (Hodan et al., BOP: Benchmark for 6D object pose estimation, ECCV 2018;
its scenes' format is described beside the BOP toolkit).

    DIR/camera.json  DIR/models/models_info.json  DIR/dataset.json
    DIR/train_pbr/000000/{rgb,depth,mask,mask_visib}/000000.png
    DIR/train_pbr/000000/{ir_left,ir_right,confidence,reason,depth_true}/000000.png  DIR/ir_cameras.json
    DIR/train_pbr/000000/{scene_camera,scene_gt,scene_gt_info}.json

The files of the third line are not BOP's but ours. confidence (0..255 for 0..1) and reason belong to the left infrared
camera; ir_cameras.json holds the reasons' names, both cameras' matrices and the baseline. Lengths in BOP's files are
millimetres. A frame's record is written after its pictures, so a frame with a record is complete.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import simsense
from activestereo.benchmarks.generate.studio import Frame, Thing
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import SIDES
from activestereo.capture.images import read_color, read_gray
from activestereo.common.accuracy import is_invented
from activestereo.common.input_files import read_json
from activestereo.common.output_files import (
    left_over,
    write_bytes,
    write_depth_png,
    write_json,
    write_png,
    written_together,
)
from activestereo.common.pose import rigid_motion
from activestereo.sensor.results import camera_info, depth_engine

SPLIT = "train_pbr"
FRAMES_PER_SCENE = 1000
_RECORDS = ".frames"
# Frames are independent; formats that need times get this rate.
FRAMES_PER_S = 30


def is_done(out: Path, number: int) -> bool:
    return record_path(out, number).exists()


def remove_left_over(out: Path, numbers: Collection[int]) -> None:
    """Removes these frames' temporary files. They remain from processes that ended before they renamed them."""
    for folder in (out / SPLIT).glob("*"):
        for name, path in left_over(folder):
            if name.isdigit() and int(name) in numbers:
                shutil.rmtree(path, ignore_errors=True)
        for path in (folder / _RECORDS).glob(".[0-9]*"):
            if int(folder.name) * FRAMES_PER_SCENE + int(path.name[1:7]) in numbers:
                path.unlink(missing_ok=True)


def write_frame(out: Path, frame: Frame) -> None:
    """Writes a frame's pictures, then its record; keeps no file if one cannot be written."""
    folder, name = scene_folder(out, frame.number), f"{frame.number % FRAMES_PER_SCENE:06d}"
    kinds = ("rgb", "depth", "ir_left", "ir_right", "confidence", "reason", "depth_true", "mask", "mask_visib")
    for kind in (*kinds, _RECORDS):
        (folder / kind).mkdir(parents=True, exist_ok=True)
    record_file = record_path(out, frame.number).relative_to(folder)
    with written_together(folder, str(frame.number), last=record_file) as aside:
        for kind in (*kinds, _RECORDS):
            (aside / kind).mkdir()
        write_png(aside / "rgb" / f"{name}.png", frame.rgb)
        write_png(aside / "ir_left" / f"{name}.png", frame.left)
        write_png(aside / "ir_right" / f"{name}.png", frame.right)
        write_png(aside / "confidence" / f"{name}.png", np.rint(255.0 * frame.confidence).astype(np.uint8))
        write_png(aside / "reason" / f"{name}.png", frame.reason)
        write_depth_png(aside / "depth" / f"{name}.png", frame.depth)
        write_depth_png(aside / "depth_true" / f"{name}.png", frame.true_depth)
        for order, found in enumerate(frame.found):
            for kind, mask in (("mask", found.mask), ("mask_visib", found.mask_visible)):
                write_png(aside / kind / f"{name}_{order:06d}.png", np.where(mask, np.uint8(255), np.uint8(0)))
        is_there, is_found = frame.true_depth > 0, frame.depth > 0
        record = {
            "camera": {
                "cam_K": frame.k.ravel().tolist(),
                "depth_scale": 1.0,
                "cam_R_w2c": frame.world_to_camera[:3, :3].ravel().tolist(),
                "cam_t_w2c": (1000.0 * frame.world_to_camera[:3, 3]).tolist(),
            },
            "gt": [
                {
                    "cam_R_m2c": found.model_to_camera[:3, :3].ravel().tolist(),
                    "cam_t_m2c": (1000.0 * found.model_to_camera[:3, 3]).tolist(),
                    "obj_id": found.thing_id,
                }
                for found in frame.found
            ],
            "gt_info": [
                {
                    "bbox_obj": _box(found.outline, found.mask_visible.shape),
                    "bbox_visib": _box(found.mask_visible),
                    "px_count_all": (whole := int(found.outline.sum())),
                    "px_count_valid": int((found.mask & is_found).sum()),
                    "px_count_visib": (visible := int(found.mask_visible.sum())),
                    "visib_fract": visible / whole if whole else 0.0,
                }
                for found in frame.found
            ],
            # Pixels with a true depth, and how many of these are measured; measured ones, and how many are invented.
            "depth": {
                "px_there": int(is_there.sum()),
                "px_measured": int((is_there & is_found).sum()),
                "px_found": int(is_found.sum()),
                "px_invented": int(is_invented(frame.depth, frame.true_depth).sum()),
            },
        }
        write_json(aside / record_file, record)


def write_files(out: Path, files: Mapping[str, bytes]) -> None:
    """Writes a frame's files, {path below `out`: content}: pictures, then the record. Keeps no file if one cannot be
    written."""
    with written_together(out, last=Path(next(name for name in files if _RECORDS in name))) as aside:
        for name, content in files.items():
            (aside / name).parent.mkdir(parents=True, exist_ok=True)
            write_bytes(aside / name, content)


def write_scenes(out: Path, count: int) -> tuple[Counter[int], Counter[str]]:
    """Writes each scene's tables from the records of its frames. Returns {obj_id: its visible pixels in all frames} of
    placed objects, and the depths' pixel counts over all frames."""
    pixels: Counter[int] = Counter()
    depths: Counter[str] = Counter()
    for first in range(0, count, FRAMES_PER_SCENE):
        records = {n % FRAMES_PER_SCENE: read_json(record_path(out, n))
                   for n in range(first, min(first + FRAMES_PER_SCENE, count))}  # fmt: skip
        for record in records.values():
            depths.update(record.get("depth", {}))  # frames of older versions have none
            for pose, info in zip(record["gt"], record["gt_info"], strict=True):
                pixels[pose["obj_id"]] += info["px_count_visib"]
        folder = scene_folder(out, first)
        for file, key in (("scene_camera", "camera"), ("scene_gt", "gt"), ("scene_gt_info", "gt_info")):
            write_json(folder / f"{file}.json", {str(n): record[key] for n, record in records.items()})
    return pixels, depths


def write_head(out: Path, things: list[Thing], config: StereoDepthSensorConfig, about: dict[str, Any]) -> None:
    """Writes the data set's common files: camera.json, ir_cameras.json, models_info.json (each thing's box
    in mm; `diameter` is the box's diagonal) and dataset.json. about: the settings, which dataset.json holds."""
    k, (width, height) = config.rgb_intrinsic, config.rgb_resolution
    camera = {"fx": k[0, 0], "fy": k[1, 1], "cx": k[0, 2], "cy": k[1, 2], "depth_scale": 1.0}
    write_json(out / "camera.json", camera | {"width": width, "height": height})
    sides = {}
    for side in SIDES:
        eye = camera_info(config, side)
        shape = {"width": eye.width, "height": eye.height, "cam_K": eye.k.ravel().tolist()}
        place = {"distortion": list(eye.distortion), "camera_to_rgb": eye.camera_to_rgb.ravel().tolist()}
        sides[f"ir_{side}"] = shape | place
    write_json(out / "ir_cameras.json", sides | {
        "baseline_m": config.baseline_m, "depth_engine": depth_engine(config), "reasons": list(simsense.REASONS),
    })  # fmt: skip
    models = {}
    for thing in things:
        low, extent = 1000.0 * thing.low_m, 1000.0 * (thing.high_m - thing.low_m)
        box = {f"min_{axis}": float(v) for axis, v in zip("xyz", low, strict=True)}
        box |= {f"size_{axis}": float(v) for axis, v in zip("xyz", extent, strict=True)}
        models[str(thing.id)] = {"diameter": float(np.linalg.norm(extent)), **box}
    (out / "models").mkdir(exist_ok=True)
    write_json(out / "models" / "models_info.json", models)
    write_json(out / "dataset.json", about)


def _box(mask: NDArray[np.bool_], first: tuple[int, ...] = (0, 0)) -> list[int]:
    """Returns a mask's bounding box [x, y, width, height]; -1 four times if the mask is empty, as in BOP. first: row
    and column of the mask that count as 0."""
    box = Image.fromarray(mask).getbbox()
    return [-1, -1, -1, -1] if box is None else [box[0] - first[1], box[1] - first[0], box[2] - box[0], box[3] - box[1]]


def scene_folder(out: Path, number: int) -> Path:
    return out / SPLIT / f"{number // FRAMES_PER_SCENE:06d}"


def record_path(out: Path, number: int) -> Path:
    return scene_folder(out, number) / _RECORDS / f"{number % FRAMES_PER_SCENE:06d}.json"


@dataclass(frozen=True)
class Stored:
    """A frame read from the data set. rgb: uint8 [h, w, 3]; depth_mm, depth_true_mm: uint16 [h, w], 0 = none; ir_left,
    ir_right: [h, w]; k: 3x3, of the RGB camera; camera_to_world: 4x4, its pose, metres, camera axes x right, y down, z
    forward."""

    number: int
    rgb: NDArray[np.uint8]
    depth_mm: NDArray[np.uint16]
    depth_true_mm: NDArray[np.uint16]
    ir_left: NDArray[Any]
    ir_right: NDArray[Any]
    k: NDArray[np.float64]
    camera_to_world: NDArray[np.float64]


def stored_frames(out: Path, count: int) -> Iterator[Stored]:
    """Reads frames 0 to count - 1 of the data set `out`, one at a time."""
    for number in range(count):
        folder, name = scene_folder(out, number), f"{number % FRAMES_PER_SCENE:06d}.png"
        depth, true, left, right = (
            read_gray(folder / kind / name) for kind in ("depth", "depth_true", "ir_left", "ir_right")
        )
        camera = read_json(record_path(out, number))["camera"]
        turn, place = np.reshape(camera["cam_R_w2c"], (3, 3)), np.array(camera["cam_t_w2c"]) / 1000.0
        camera_to_world = np.linalg.inv(rigid_motion(place, turn))
        k = np.reshape(np.array(camera["cam_K"], np.float64), (3, 3))
        yield Stored(number, read_color(folder / "rgb" / name), depth, true, left, right, k, camera_to_world)
