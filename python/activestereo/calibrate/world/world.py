# SPDX-License-Identifier: Apache-2.0
"""From a recording with depth to a capture that the lab can use: camera, poses, pattern, exposures and albedo, one
after the other.

Each step replaces its own part of the capture and says in `measured` how well it is known; what the user knows better
is kept by leaving its step out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.camera import CameraEstimate, camera_from_boards, camera_from_overlaps, information_of
from activestereo.calibrate.world.light import darkness
from activestereo.calibrate.world.light_steps import Progress, albedo_step, exposure_step
from activestereo.calibrate.world.pair_geometry import pair_geometry
from activestereo.calibrate.world.pattern import recover_pattern
from activestereo.calibrate.world.pictures import poses_picture, write_pictures
from activestereo.calibrate.world.poses import PoseEstimate, group_views, solve_poses
from activestereo.calibrate.world.state import World
from activestereo.calibrate.world.views import read_views
from activestereo.capture.capture import SIDES, Frame, read_capture
from activestereo.capture.write import write_capture
from activestereo.common.progress_bar import part_of

STEPS = ("camera", "poses", "pattern", "exposure", "albedo")
# Steps that compare the surfaces of all views.
_OF_SURFACES = ("camera", "poses")
# Inverse covariances of (f, cx, cy) around the nominal camera: hardly known, and held.
_HARDLY_KNOWN, _HELD = np.diag([1 / 40.0**2] * 3), np.diag([1e8] * 3)
_LEAST_ON = 0.85
# The camera has turned where the picture moves by this share of its width: else the lens's falloff stays untold.
_LEAST_TURN = 0.02
_Z90 = 1.645


def calibrate_world(
    recording: Path, out: Path, steps: Sequence[str] = STEPS, test: Sequence[int] = (), seed: int = 0,
    progress: Progress = None,
) -> list[str]:  # fmt: skip
    """Measures a recording (a capture folder of views with depth) by some of STEPS and writes the capture `out`, with
    pictures of each step in `out`/measured. Returns what was found, a line each.

    test: ids of frames that are held out: their pose and exposure are measured, and nothing is measured on them.
    ValueError says in one line why a recording cannot be used, and what to record instead; what could be measured is
    written all the same.
    """
    capture = read_capture(recording)
    unknown = sorted(set(test) - {frame.id for frame in capture.frames})
    if unknown:
        raise ValueError(
            f"{recording}: there is no frame {unknown[0]} to hold out: its frames are {_ids(capture.frames)}"
        )
    frames = tuple(replace(f, split="test" if f.id in test or f.split == "test" else "train") for f in capture.frames)
    capture = replace(capture, frames=frames)
    views, refused = read_views(capture, part_of(progress, 0.0, 0.1))
    pattern = np.rint(255 * capture.rig.projector.pattern()).astype(np.uint8)
    world = World(capture, views, pattern, refused)
    failed: ValueError | None = None
    if not set(_OF_SURFACES).isdisjoint(steps):
        world.surfaces, world.overlaps, world.groups = group_views(views, world.K, seed, part_of(progress, 0.1, 0.35))
    with TemporaryDirectory() as temporary:
        for step in (s for s in STEPS if s in steps):
            if failed is None or step == "pattern":  # which needs no step before it
                try:
                    _STEP[step](world, seed, Path(temporary), part_of(progress, *_SHARE[step]))
                except ValueError as error:
                    failed = failed or error
        if failed is not None and world.capture.measured == capture.measured:
            raise failed
        _write(world, out, Path(temporary))
    if failed is not None:
        new = ", ".join(name for name, value in world.capture.measured.items() if value != capture.measured.get(name))
        raise ValueError(f"{failed}; {new}, which could be measured, in {out}")
    return world.lines


def _camera(world: World, seed: int, folder: Path, progress: Progress) -> None:
    found = [
        solve_poses(world.surfaces, world.overlaps, group, world.K, _HARDLY_KNOWN)
        for group in world.groups
        if len(group) > 1
    ]
    estimate = camera_from_overlaps([f.camera for f in found]) or camera_from_boards(world.views, world.capture.rig)
    rig = world.capture.rig
    if estimate is None:
        estimate = CameraEstimate(
            np.array([rig.left.K[0, 0], rig.left.K[0, 2], rig.left.K[1, 2]]), np.diag([np.inf] * 3), "nominal",
            "camera: nominal: no two views overlap and differ, and fewer than 4 show a chessboard",
        )  # fmt: skip
    shift = estimate.K - rig.left.K
    left = replace(rig.left, K=estimate.K)
    right = replace(rig.right, K=rig.right.K + shift)
    pair = pair_geometry(world.views, replace(rig, left=left, right=right))
    left_to_right = rig.left_to_right.copy()
    left_to_right[:3, 3] *= pair.baseline_m / rig.baseline_m
    right.K[:2, 2] += pair.column_px, pair.row_px
    world.capture = replace(world.capture, rig=replace(rig, left=left, right=right, left_to_right=left_to_right))
    values = {
        "f_cx_cy_px": estimate.mean.tolist(),
        "covariance_px2": None if estimate.source == "nominal" else estimate.covariance.tolist(),
        "from": estimate.source,
        **pair.as_json(),
    }
    world.note("camera", values, f"{estimate.text}\n{pair.text}")


def _poses(world: World, seed: int, folder: Path, progress: Progress) -> None:
    group = world.groups[0]
    if len(group) < 2:
        raise ValueError(
            f"{world.where}: no two of its {len(world.views)} views overlap: record views of one scene that share a "
            "third of the picture, and let nothing move"
        )
    estimate = solve_poses(world.surfaces, world.overlaps, group, world.K, _HELD)
    for overlap in estimate.overlaps:
        if overlap.on < _LEAST_ON:
            a, b = (world.views[i].frame.id for i in (overlap.a, overlap.b))
            raise ValueError(
                f"{world.where}: the scene moves: {100 * (1 - overlap.on):.0f} % of what frames {a} and {b} both see "
                "lies elsewhere: record a static scene, or leave one of them out"
            )
    nearest = min(float(np.median(world.views[i].depth_m[world.views[i].depth_m > 0])) for i in group)
    if max(_turn(overlap.a_to_b, nearest) for overlap in estimate.overlaps) * world.K[0, 0] < (
        _LEAST_TURN * world.views[0].left.shape[1]
    ):
        raise ValueError(
            f"{world.where}: its {len(group)} views look the same way from one place: turn the camera by 10 to 30 "
            "degrees between views, or move it"
        )
    covariance = _with_camera(world, group, estimate)
    world.poses = estimate
    world.pictures["poses"] = poses_picture(*world.scene_views(), world.K)
    pose_of = {world.views[i].frame.id: p for i, p in zip(group, estimate.view_to_world, strict=True)}
    others = sorted(f.id for f in world.capture.frames if f.id not in pose_of)
    posed = tuple(replace(f, camera_to_world=pose_of[f.id]) for f in world.capture.frames if f.id in pose_of)
    world.capture = replace(world.capture, frames=posed)
    sd = _Z90 * np.sqrt(np.diag(covariance)).reshape(-1, 6)[1:].max(axis=0)
    line = (
        f"poses: {len(group)} views of one scene, {1e3 * estimate.distance_m:.2f} mm from each other's planes in the "
        f"median; +- {1e3 * sd[3:].max():.2f} mm, {np.degrees(sd[:3].max()):.3f} degrees (90 %)"
    )
    if others:
        line += f"; frames {', '.join(map(str, others))} show other scenes and tell of camera and pattern alone"
    values = {
        "frames": list(pose_of),
        "covariance_rad_m": covariance.tolist(),
        "distance_m": estimate.distance_m,
    }
    world.note("poses", values, line)


def _turn(pose: NDArray[np.float64], distance_m: float) -> float:
    """The angle, rad, by which a motion moves things at a distance."""
    turn = np.arccos(np.clip(0.5 * (np.trace(pose[:3, :3]) - 1.0), -1.0, 1.0))
    return float(turn + np.linalg.norm(pose[:3, 3]) / distance_m)


def _with_camera(world: World, group: Sequence[int], poses: PoseEstimate) -> NDArray[np.float64]:
    """The covariance of poses with what the camera's own leaves open."""
    told = world.capture.measured.get("camera", {}).get("covariance_px2")
    if told is None:
        return poses.covariance
    return solve_poses(world.surfaces, world.overlaps, group, world.K, information_of(told)).covariance


def _pattern(world: World, seed: int, folder: Path, progress: Progress) -> None:
    rig = world.capture.rig
    test = {f.id for f in world.capture.frames if f.split == "test"}
    views = [v for v in world.views if v.frame.split == "train" and v.frame.id not in test]
    start = np.linalg.inv(rig.projector.left_to_projector)[:3, 3]
    scene = {world.views[i].frame.id: number for number, group in enumerate(world.groups) for i in group}
    scenes = [scene[v.frame.id] for v in views] if scene else None
    dots = recover_pattern(views, world.K, start, rig.max_dn, seed, scenes, progress)
    world.dots = dots
    light = np.nan_to_num(dots.image + darkness(dots), nan=0.0).clip(0.0)
    world.pattern = np.rint(np.minimum(255.0 * light / np.quantile(light[light > 0], 0.9995), 255.0)).astype(np.uint8)
    world.pictures["pattern"] = world.pattern
    left_to_projector = np.eye(4)
    left_to_projector[:3, 3] = -dots.place
    projector = replace(rig.projector, K=dots.K, left_to_projector=left_to_projector)
    world.capture = replace(world.capture, rig=replace(rig, projector=projector))
    sd = _Z90 * 1e3 * np.sqrt(np.diag(dots.covariance))
    place = ", ".join(f"{1e3 * x:.2f} +- {s:.2f}" for x, s in zip(dots.place, sd, strict=True))
    values = {
        "place_m": dots.place.tolist(),
        "covariance_m2": dots.covariance.tolist(),
        "left_out_r": {str(k): round(v, 4) for k, v in dots.r.items()},
        "is_common": dots.is_common,
    }
    if not dots.is_common:
        line = (
            f"pattern: the views share no dots (r {dots.r_median():.2f} in the median): each view's own stand in, at "
            "the projector's stated place"
        )
        world.note("pattern", values, line)
        return
    line = (
        f"pattern: projector at ({place}) mm in the left camera's frame (90 %); each view's dots correlate "
        f"{dots.r_median():.2f} in the median ({min(dots.r.values()):.2f} to {max(dots.r.values()):.2f}) with what the "
        "others predict"
    )
    world.note("pattern", values, line)


_STEP = {
    "camera": _camera,
    "poses": _poses,
    "pattern": _pattern,
    "exposure": exposure_step,
    "albedo": albedo_step,
}
_SHARE = {
    "camera": (0.35, 0.45),
    "poses": (0.45, 0.5),
    "pattern": (0.5, 0.85),
    "exposure": (0.85, 0.9),
    "albedo": (0.9, 1.0),
}


def _write(world: World, out: Path, folder: Path) -> None:
    capture, whole = world.capture, read_capture(world.capture.path)
    dtype = np.uint8 if capture.rig.bit_depth <= 8 else np.uint16
    frames: Sequence[Frame] = [f for f in capture.frames if f.has_infrared]
    images = {(f.id, side): whole.ir(f, side).astype(dtype) for f in frames for side in SIDES}
    known = {(f.id, side): mask for f in frames for side in SIDES if (mask := whole.known(f, side)) is not None}
    depths, colors = {}, {}
    for frame in capture.frames:
        depth, color = whole.depth(frame), whole.color(frame)
        if depth is not None and frame.depth_scale is not None:
            depths[frame.id] = np.rint(depth / frame.depth_scale).astype(np.uint16)
        if color is not None:
            colors[frame.id] = color
    named = replace(capture, name=out.name)
    write_capture(out, named, images, world.pattern, depths, colors, known | world.masks)
    write_pictures(out / "measured", world.pictures)


def _ids(frames: Sequence[Frame]) -> str:
    return ", ".join(str(frame.id) for frame in frames)
