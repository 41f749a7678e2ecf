# SPDX-License-Identifier: Apache-2.0
"""Writes a capture folder: PNG, JSON and glTF by the standards, without the product's writers."""

import json
from pathlib import Path

import numpy as np
from PIL import Image

from virtual_sensor.held_out.rig import HEIGHT, WIDTH
from virtual_sensor.held_out.scene import gltf_pieces
from virtual_sensor.gltf import write_gltf

DEPTH_SCALE = 0.001


# Standard deviations of a good survey: metres and radians of poses and of the projector, relative focal length, albedo.
SURVEY = {
    "pose_m": 1e-3, "pose_rad": 1.5e-3, "projector_m": 3e-4, "projector_rad": 1e-3, "focal": 6e-4, "albedo": 0.03,
}  # fmt: skip


def write_capture(folder, name, rig, solids, frames, images, depths, max_disparity, line_time_s=None, survey=1.0):
    """Writes a capture folder. rig, solids: as the user believes them. images: {(frame id, side): uint8}; depths:
    {frame id: metres}. survey: the stated uncertainty in units of a good survey's errors."""
    folder = Path(folder)
    for part in ("left", "right", "depth"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    write_gltf(folder, gltf_pieces(solids))
    Image.fromarray(np.rint(255 * rig.pattern).astype(np.uint8)).save(folder / "pattern.png")
    for (frame_id, side), image in images.items():
        Image.fromarray(image).save(folder / side / f"{frame_id:06}.png")
    for frame_id, depth in depths.items():
        counts = np.rint(depth / DEPTH_SCALE).clip(0, 65535).astype(np.uint16)
        Image.fromarray(counts).save(folder / "depth" / f"{frame_id:06}.png")
    document = {
        "format": "active-stereo-capture",
        "version": 1,
        "name": name,
        "scene": "scene.gltf",
        "rig": _rig(rig, line_time_s),
        "depth_engine": {
            "max_disparity": max_disparity,
            "notes": "census + 8-path SGM, left-right check, 1/16 px, 3x3 median",
        },
        "frames": [_frame(frame, frame.id in depths) for frame in frames],
    }
    if survey != 1.0:
        document["uncertainty"] = {name: survey * deviation for name, deviation in SURVEY.items()}
    (folder / "capture.json").write_text(json.dumps(document, indent=1))


def _rig(rig, line_time_s):
    camera = {"width": WIDTH, "height": HEIGHT, "K": _list(rig.camera_K()), "distortion": [0.0] * 5}
    return {
        "left": camera,
        "right": camera,
        "left_to_right": _list(_shift(-rig.baseline_m)),
        "projector": {
            "pattern": "pattern.png",
            "K": _list(rig.projector_K()),
            "left_to_projector": _list(_shift(-rig.projector_x_m)),
        },
        "bit_depth": 8,
        "readout": {"line_time_s": line_time_s},
    }


def _frame(frame, has_depth):
    name = f"{frame.id:06}.png"
    depth = {"depth": f"depth/{name}", "depth_scale": DEPTH_SCALE} if has_depth else {}
    return {
        "id": frame.id,
        "left": f"left/{name}",
        "right": f"right/{name}",
        **depth,
        "timestamp_s": round(float(frame.timestamp_s), 4),
        "exposure_s": float(f"{frame.exposure_s:.9g}"),
        "gain": frame.gain,
        "projector_power": frame.power,
        "ambient": None,
        "temperature_c": frame.temperature_c,
        "camera_to_world": _list(frame.camera_to_world),
        "camera_velocity": [float(f"{x:.9g}") for x in frame.twist],
        "repeat_group": frame.repeat_group,
        "split": frame.split,
    }


def _list(matrix):
    return [float(f"{x:.12g}") for x in np.asarray(matrix).ravel()]


def _shift(x):
    pose = np.eye(4)
    pose[0, 3] = x
    return pose
