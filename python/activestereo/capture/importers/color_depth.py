# SPDX-License-Identifier: Apache-2.0
"""Converts recordings of colour and depth without infrared images to captures, and reads folders in three layouts.

TUM RGB-D benchmark (Sturm et al., IROS 2012): rgb.txt and depth.txt list files by time, groundtruth.txt the camera's
poses; depth images have 5000 units per metre.

Open3D's recorders: color/, depth/ and camera_intrinsic.json (K column by column). Camera poses are in trajectory.log,
or in trajectory.json, which Open3D's viewer saves.

One scene of a BOP benchmark data set (Hodan et al., ECCV 2018): rgb/ or gray/, depth/, scene_camera.json with K and
millimetres, and scene_gt.json with the objects' poses; models/ lies beside the data set's scenes. The world is that of
cam_R_w2c. Without it the world is the first frame's camera, and the first object's poses place the other cameras.

Depth lies on the colour image's pixels, as if one camera took both, unless the colour camera is stated."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Camera, Capture, ColorCamera, Frame, Projector, Rig
from activestereo.capture.images import image_size
from activestereo.capture.importers.frames import pose_at, read_trajectory, write_frames
from activestereo.common.input_files import read_json_object, read_text
from activestereo.common.limits import camera_matrix_fault
from activestereo.common.output_files import png_bytes
from activestereo.common.own_files import own_file
from activestereo.common.pose import printed_motion, rigid_motion
from activestereo.common.progress_bar import Progress, silent
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.parts import read_parts


@dataclass(frozen=True)
class ColorDepthFrame:
    """The image files of one moment. depth_scale: metres per unit of the depth file. camera_to_world: 4x4, or None if
    unknown."""

    time_s: float
    depth: Path
    color: Path | None
    depth_scale: float
    camera_to_world: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class ColorDepthRecording:
    """A recording of colour and depth. K: 3x3 of both images, pixels. kind: name of the folder's layout. scene: a glTF
    file of the objects in view, or None. color: the colour camera, if depth does not lie on its pixels. assumed:
    messages on assumptions, for the user."""

    path: Path
    kind: str
    K: NDArray[np.float64]
    frames: tuple[ColorDepthFrame, ...]
    scene: Path | None = None
    color: ColorCamera | None = None
    assumed: tuple[str, ...] = ()


def camera_matrix_of(path: Path, key: str, values: object, order: Literal["C", "F"] = "C") -> NDArray[np.float64]:
    """Checks nine numbers as a camera matrix and returns it as 3x3. order: "C" row by row, "F" column by column. Raises
    ValueError with file, key and value."""
    try:
        K = np.array(values, dtype=np.float64).reshape(9).reshape(3, 3, order=order)
    except (TypeError, ValueError):
        told = "nine numbers, row by row" if order == "C" else "nine numbers, column by column"
        raise ValueError(f"{path}: {key}: is {values!r}, expected {told}") from None
    if (fault := camera_matrix_fault(K)) is not None:
        raise ValueError(f"{path}: {key}: {K.ravel().tolist()} {fault}")
    return K


def image_files(folder: Path) -> dict[str, Path]:
    """Lists a folder's PNG and JPEG files, {name without suffix: path}, in order of their paths."""
    files = [*folder.glob("*.png"), *folder.glob("*.jpg"), *folder.glob("*.jpeg")] if folder.is_dir() else []
    return {file.stem: file for file in sorted(files)}


def write_color_depth(
    recording: ColorDepthRecording, out: Path, baseline_m: float, projector: Projector, pattern: NDArray[np.uint8],
    scene: Path | None = None, progress: Progress = silent,
) -> Capture:  # fmt: skip
    """Writes a recording as the capture `out`, which must not exist, and returns it. baseline_m, projector, pattern:
    the preset's, because such a recording has none. scene: a glTF file in place of the recording's. Raises ValueError
    with the file if sizes differ, depth has 8 bits or a file is damaged."""
    width, height = image_size(recording.frames[0].depth, "Depth")
    cx, cy = recording.K[:2, 2]
    if not (0 <= cx < width and 0 <= cy < height):
        text = f"K has its centre at {cx:g}, {cy:g}, outside of the depth images' {width}x{height}"
        raise ValueError(f"{recording.path}: {text}: were they rescaled? K is scaled along with them")
    camera, has_color = Camera(width, height, recording.K), any(entry.color is not None for entry in recording.frames)
    frames = tuple(
        Frame(
            number, None, None, entry.time_s, 0.008,
            np.eye(4) if entry.camera_to_world is None else entry.camera_to_world, "train", depth_path=entry.depth,
            depth_scale=entry.depth_scale, color_path=entry.color,
        )
        for number, entry in enumerate(recording.frames)
    )  # fmt: skip
    left_to_right = rigid_motion((-baseline_m, 0.0, 0.0))
    color = (recording.color or ColorCamera(width, height, recording.K)) if has_color else None
    rig = Rig(camera, camera, left_to_right, projector, color=color)
    notes = f"imported from {recording.kind}: colour and depth, no infrared; baseline and pattern are nominal"
    place = scene or recording.scene or out / "scene.gltf"
    is_placed = any(entry.camera_to_world is not None for entry in recording.frames)
    views = None if is_placed else [entry.color is not None for entry in recording.frames]
    return write_frames(Capture(out, out.name, place, rig, frames, {"notes": notes}), pattern, views, progress)


def nearest(times: Iterable[float], time_s: float, within_s: float) -> float | None:
    """Returns the time in `times` nearest to time_s, or None if none is within within_s seconds of it."""
    found = min(times, key=lambda t: abs(t - time_s), default=None)
    return found if found is not None and abs(found - time_s) <= within_s else None


_RATE_HZ = 30.0
_MM = 0.001
_GREY = [0.5, 0.5, 0.5, 1.0]
_TUM_UNIT_M = 1.0 / 5000.0
_WITHIN_S = 0.02
INTRINSICS = ("camera_intrinsic.json", "intrinsic.json")
_TRAJECTORIES = ("trajectory.log", "scene/trajectory.log", "trajectory.json", "scene/trajectory.json")


def read_tum(folder: Path, K: NDArray[np.float64] | None, depth_scale: float | None = None) -> ColorDepthRecording:
    """Reads a folder of the TUM layout. K: 3x3 of the colour camera; required, because the layout has none. Raises
    ValueError with file, line and value."""
    if K is None:
        raise ValueError(f"{folder}: K: the TUM layout has none: give --k FX,FY,CX,CY of the colour camera")
    colors, depths = (_tum_files(folder / name) for name in ("rgb.txt", "depth.txt"))
    poses = read_trajectory(folder / "groundtruth.txt") if (folder / "groundtruth.txt").is_file() else None
    frames = []
    for time_s, depth in depths.items():
        at = nearest(colors, time_s, _WITHIN_S)
        if at is None or (poses is not None and not poses[0][0] - 0.05 <= time_s <= poses[0][-1] + 0.05):
            continue  # recordings begin and end a little before and after their poses
        pose = None if poses is None else pose_at(*poses, time_s, str(depth))
        frames.append(ColorDepthFrame(time_s, depth, colors[at], depth_scale or _TUM_UNIT_M, pose))
    if not frames:
        raise ValueError(f"{folder}: no depth image has a colour image within {_WITHIN_S} s and a pose")
    return ColorDepthRecording(folder, "a TUM folder", K, tuple(frames))


def _tum_files(path: Path) -> dict[float, Path]:
    out: dict[float, Path] = {}
    for number, line in enumerate(read_text(path).splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        try:
            time_s = float(words[0])
        except ValueError:
            time_s = np.nan
        if len(words) != 2 or not np.isfinite(time_s):
            raise ValueError(f"{path}: line {number}: '{line.strip()}' is not a time and a file")
        try:
            out[time_s] = own_file(path.parent, words[1])
        except ValueError as error:
            raise ValueError(f"{path}: line {number}: {error}") from error
    return out


def read_open3d(
    folder: Path, K: NDArray[np.float64] | None = None, depth_scale: float | None = None
) -> ColorDepthRecording:
    """Reads a folder of Open3D's layout. K and depth_scale, if given, override the folder's. Raises ValueError with
    file, key and value."""
    path = next(folder / name for name in INTRINSICS if (folder / name).is_file())
    intrinsics = read_json_object(path)
    if K is None:
        if "intrinsic_matrix" not in intrinsics:
            raise ValueError(f"{path}: intrinsic_matrix: is missing: give --k FX,FY,CX,CY")
        K = camera_matrix_of(path, "intrinsic_matrix", intrinsics["intrinsic_matrix"], "F")
    colors, depths = image_files(folder / "color"), image_files(folder / "depth")
    if not depths:
        raise ValueError(f"{folder / 'depth'}: holds no PNG files")
    poses = _open3d_poses(folder)
    if poses is not None and len(poses) != len(depths):
        raise ValueError(f"{folder}: the trajectory has {len(poses)} poses, depth/ {len(depths)} images")
    scale = depth_scale or (1.0 / float(intrinsics["depth_scale"]) if intrinsics.get("depth_scale") else _MM)
    frames = [
        ColorDepthFrame(number / _RATE_HZ, file, colors.get(name), scale, None if poses is None else poses[number])
        for number, (name, file) in enumerate(depths.items())
    ]
    return ColorDepthRecording(folder, "an Open3D folder", K, tuple(frames))


def _open3d_poses(folder: Path) -> list[NDArray[np.float64]] | None:
    path = next((folder / name for name in _TRAJECTORIES if (folder / name).is_file()), None)
    if path is None:
        return None
    blocks: list[Any]
    if path.suffix == ".log":
        rows = [line.split() for line in read_text(path).splitlines() if line.strip()]
        blocks = [rows[k + 1 : k + 5] for k in range(0, len(rows), 5)]
    else:
        # Column by column, and from the world to the camera.
        blocks = [np.reshape(entry["extrinsic"], (4, 4)).T for entry in read_json_object(path).get("parameters", [])]
    out = []
    for number, block in enumerate(blocks):
        try:
            pose = np.array(block, dtype=np.float64).reshape(4, 4)
        except ValueError:
            raise ValueError(f"{path}: pose {number}: is not a 4x4 of numbers") from None
        pose = printed_motion(pose[:3, :3], pose[:3, 3], f"{path}: pose {number}", pose[3])
        out.append(pose if path.suffix == ".log" else np.linalg.inv(pose))
    return out


def read_bop(folder: Path, scene: Path, depth_scale: float | None = None) -> ColorDepthRecording:
    """Reads one scene of a BOP data set. scene: path for a glTF file of the objects in view, which is written if there
    are models. Raises ValueError with file, key and value."""
    path = folder / "scene_camera.json"
    cameras, poses = read_json_object(path), folder / "scene_gt.json"
    truth = read_json_object(poses) if poses.is_file() else {}
    depths, colors = image_files(folder / "depth"), image_files(folder / "rgb") or image_files(folder / "gray")
    frames, Ks, first = [], [], min(cameras, key=int, default="")
    for number, name in enumerate(sorted(cameras, key=int)):
        entry, stem = cameras[name], f"{int(name):06d}"
        if stem not in depths:
            raise ValueError(f"{folder / 'depth'}: {stem}.png: is missing, scene_camera.json has frame {name}")
        Ks.append(camera_matrix_of(path, f"{name}.cam_K", entry.get("cam_K")))
        if depth_scale is None and not entry.get("depth_scale"):
            raise ValueError(f"{path}: {name}.depth_scale: is missing: give --depth-scale")
        scale = _MM * float(entry["depth_scale"]) if depth_scale is None else depth_scale
        pose: NDArray[np.float64] | None = None
        if "cam_R_w2c" in entry:
            pose = np.linalg.inv(_bop_motion(path, name, entry, "w2c"))
        elif truth.get(name) and truth.get(first):
            here, there = (_bop_motion(path, n, truth[n][0], "m2c") for n in (name, first))
            pose = there @ np.linalg.inv(here)
        frames.append(ColorDepthFrame(number / _RATE_HZ, depths[stem], colors.get(stem), scale, pose))
    if not frames:
        raise ValueError(f"{path}: has no frames")
    if any(not np.allclose(K, Ks[0], atol=1e-6) for K in Ks):
        raise ValueError(f"{path}: cam_K: differs between the frames: import frames of one camera")
    # The objects of the first frame that have models.
    models = next((p / "models" for p in (folder.parent, folder.parent.parent) if (p / "models").is_dir()), None)
    to_world, writer, has_objects = frames[0].camera_to_world, GltfWriter("activestereo import"), False
    for number, entry in enumerate(truth.get(first, []) if models is not None and to_world is not None else ()):
        assert models is not None and to_world is not None
        file = models / f"obj_{int(entry['obj_id']):06d}.ply"
        if not file.is_file():
            continue
        name = f"object {entry['obj_id']}" + (f" ({number})" if number else "")
        pose = to_world @ _bop_motion(folder / "scene_gt.json", first, entry, "m2c")
        for part in read_parts(file):
            # The red of a part's colours is its infrared albedo (the capture's specification); one without colours is
            # grey.
            pbr: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.6}
            if part.material is not None:
                pbr["baseColorFactor"] = list(part.material.base_color)
            elif part.colors is None:
                pbr["baseColorFactor"] = _GREY
            if "base_color_texture" in part.textures:
                texture = part.textures["base_color_texture"]
                png = png_bytes(np.squeeze(texture["texels"]))
                pbr["baseColorTexture"] = {"index": writer.add_texture(png, texture["name"])}
            mesh = replace(part.mesh, positions=part.mesh.positions * np.float32(_MM))
            material = writer.add_material(name, pbrMetallicRoughness=pbr)
            writer.place(name, writer.add_shape(name, mesh, material, part.colors), pose)
        has_objects = True
    if has_objects:
        writer.write(scene)
    return ColorDepthRecording(folder, "a BOP scene", Ks[0], tuple(frames), scene if has_objects else None)


def _bop_motion(path: Path, key: str, entry: dict[str, Any], way: str) -> NDArray[np.float64]:
    """Reads the 4x4 pose in metres of an entry's cam_R_ and cam_t_. way: w2c (world to camera) or m2c (model to
    camera)."""
    name, translation = f"{path}: {key}.cam_R_{way}, cam_t_{way}", entry.get(f"cam_t_{way}")
    pose = printed_motion(entry[f"cam_R_{way}"], translation if translation is not None else (), name)
    pose[:3, 3] *= _MM
    return pose
