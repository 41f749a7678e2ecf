# SPDX-License-Identifier: Apache-2.0
"""Turns a recording with depth into a capture for diagnosis: measures camera, poses, pattern, exposures and albedo, one
after the other.

Each step replaces its own part of the capture and states its uncertainty in `measured`. Omit a step to keep a better
value of your own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.joint import block, read_covariance
from activestereo.calibrate.world.light import (
    BLACK_BY_EXPOSURES_DN,
    LINEAR,
    LightEstimate,
    black_level,
    darkness,
    light_view,
    merged_textures,
    response_of,
    solve_light,
)
from activestereo.calibrate.world.mesh import known_masks, write_scene
from activestereo.calibrate.world.overlaps import MOVED_ON, Overlap, Surface, find_overlap
from activestereo.calibrate.world.pair_geometry import pair_geometry
from activestereo.calibrate.world.pattern import PatternEstimate, recover_pattern
from activestereo.calibrate.world.pictures import exposure_picture, poses_picture, scene_pictures
from activestereo.calibrate.world.poses import (
    CameraEstimate,
    PoseEstimate,
    camera_from_overlaps,
    group_views,
    solve_poses,
)
from activestereo.calibrate.world.views import SceneView, read_views
from activestereo.capture.capture import SIDES, Capture, read_capture
from activestereo.capture.write import write_capture
from activestereo.common.output_files import write_png
from activestereo.common.pose import rigid_motion
from activestereo.common.progress_bar import Progress, part_of, silent

# Inverse covariances of (f, cx, cy) around the nominal camera: hardly known, and held.
_HARDLY_KNOWN, _HELD = np.diag([1 / 40.0**2] * 3), np.diag([1e8] * 3)
_LEAST_ON = 0.85
# The camera has turned if the picture moves by this share of its width. Else lens falloff cannot be measured.
_LEAST_TURN = 0.02
_Z90 = 1.645
# Relative exposures from overlaps are no more accurate than this.
_LEAST_EXPOSURE = 0.005
# The pattern's image is unknown where nothing shines within a square of this side, in its pixels.
_LIT_PX = 41


@dataclass
class World:
    """The capture between steps. lines: each step's findings, for the user. surfaces, overlaps, groups: of views, for
    steps that compare their surfaces. poses, dots: as measured in this run, or None. pictures: by file name."""

    capture: Capture
    views: list[SceneView]
    pattern: NDArray[np.uint8]
    lines: list[str] = field(default_factory=list)
    surfaces: list[Surface] = field(default_factory=list)
    overlaps: list[Overlap] = field(default_factory=list)
    groups: list[list[int]] = field(default_factory=list)
    poses: PoseEstimate | None = None
    dots: PatternEstimate | None = None
    masks: dict[tuple[int, str], NDArray[np.bool_]] = field(default_factory=dict)
    pictures: dict[str, NDArray[np.uint8]] = field(default_factory=dict)

    @property
    def K(self) -> NDArray[np.float64]:
        return self.capture.rig.left.K

    @property
    def where(self) -> str:
        return str(self.capture.path)

    def note(self, name: str, values: dict[str, Any], line: str) -> None:
        """Stores a step's result: `values` under `name` in the capture's `measured`, and `line` for the user."""
        self.capture = replace(self.capture, measured={**self.capture.measured, name: values})
        self.lines.append(line)

    def scene_views(self) -> tuple[list[SceneView], list[NDArray[np.float64]]]:
        """Returns the views of one scene and their 4x4 view_to_world, measured in this run or else the capture's.
        Raises ValueError if there are none."""
        if self.poses is not None:
            return [self.views[i] for i in self.poses.views], list(self.poses.view_to_world)
        frames = {frame.id: frame.camera_to_world for frame in self.capture.frames}
        views = [view for view in self.views if view.frame.id in frames]
        if len({frames[view.frame.id].tobytes() for view in views}) < min(len(views), 2):
            raise ValueError(f"{self.where}: its views have no poses: take 'calibrate poses' first, or give them")
        return views, [frames[view.frame.id] for view in views]

    def projected(self) -> PatternEstimate:
        """Returns the projector's dots, measured in this run or else the capture's pattern."""
        if self.dots is not None:
            return self.dots
        projector = self.capture.rig.projector
        shining = cv2.dilate((self.pattern > 0).astype(np.uint8), np.ones((_LIT_PX, _LIT_PX), np.uint8)) > 0
        image = np.where(shining, self.pattern / np.float32(255.0), np.nan).astype(np.float32)
        place = np.linalg.inv(projector.left_to_projector)[:3, 3]
        return PatternEstimate(image, projector.K, place, np.zeros((3, 3)), {})


def calibrate_world(
    recording: Path, out: Path, steps: Sequence[str] | None = None, test: Sequence[int] = (), seed: int = 0,
    progress: Progress = silent,
) -> list[str]:  # fmt: skip
    """Measures a recording (a capture folder of views with depth) by some of STEPS, None: all. Writes the
    capture `out`, with pictures of each step in `out`/measured. Returns the findings, a line each.

    test: ids of frames to hold out; their pose and exposure are measured, but they inform nothing else. Raises
    ValueError, one line, if a recording is unusable, with the remedy; the parts that could be measured are written all
    the same."""
    capture = read_capture(recording)
    unknown = sorted(set(test) - {frame.id for frame in capture.frames})
    if unknown:
        ids = ", ".join(str(frame.id) for frame in capture.frames)
        raise ValueError(f"{recording}: there is no frame {unknown[0]} to hold out: its frames are {ids}")
    frames = tuple(replace(f, split="test" if f.id in test or f.split == "test" else "train") for f in capture.frames)
    capture = replace(capture, frames=frames)
    views, refused = read_views(capture, part_of(progress, 0.0, 0.1))
    pattern = np.rint(255 * capture.rig.projector.pattern()).astype(np.uint8)
    world = World(capture, views, pattern, refused)
    failed: ValueError | None = None
    steps = tuple(STEPS) if steps is None else steps
    if "camera" in steps or "poses" in steps:  # which compare the surfaces of all views
        world.surfaces, world.overlaps, world.groups = group_views(views, world.K, seed, part_of(progress, 0.1, 0.35))
    with TemporaryDirectory() as temporary:
        for step, (measure, *share) in STEPS.items():
            if step in steps and (failed is None or step == "pattern"):  # which needs no step before it
                try:
                    measure(world, seed, Path(temporary), part_of(progress, *share))
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
    estimate, rig = camera_from_overlaps([f.camera for f in found]), world.capture.rig
    if estimate is None:
        estimate = CameraEstimate(
            np.array([rig.left.K[0, 0], rig.left.K[0, 2], rig.left.K[1, 2]]), np.diag([np.inf] * 3), "nominal",
            "camera: nominal: no two views overlap and differ: 'calibrate rig' measures it from a board",
        )  # fmt: skip
    left = replace(rig.left, K=estimate.K)
    right = replace(rig.right, K=rig.right.K + estimate.K - rig.left.K)
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
        for (a, first), (b, second) in combinations(enumerate(world.surfaces), 2):
            if overlap := find_overlap(a, b, first, second, world.K, MOVED_ON):
                raise _moves(world, overlap)
        raise ValueError(
            f"{world.where}: no two of its {len(world.views)} views overlap: record views of one scene that share a "
            "third of the picture, and let nothing move"
        )
    estimate = solve_poses(world.surfaces, world.overlaps, group, world.K, _HELD)
    for overlap in estimate.overlaps:
        if overlap.on < _LEAST_ON:
            raise _moves(world, overlap)
    nearest = min(float(np.median(world.views[i].depth_m[world.views[i].depth_m > 0])) for i in group)
    if max(_turn(overlap.a_to_b, nearest) for overlap in estimate.overlaps) * world.K[0, 0] < (
        _LEAST_TURN * world.views[0].left.shape[1]
    ):
        raise ValueError(
            f"{world.where}: its {len(group)} views look the same way from one place: turn the camera by 10 to 30 "
            "degrees between views, or move it"
        )
    camera = world.capture.measured.get("camera", {}).get("covariance_px2")
    if camera is not None:
        camera = read_covariance(camera, 3, "camera", "covariance_px2")
    joint = _poses_joint(estimate, [world.views[i].frame.id for i in group], camera, world.K[0, 0])
    world.poses = estimate
    world.pictures["poses"] = poses_picture(*world.scene_views(), world.K)
    pose_of = {world.views[i].frame.id: p for i, p in zip(group, estimate.view_to_world, strict=True)}
    others = sorted(f.id for f in world.capture.frames if f.id not in pose_of)
    posed = tuple(replace(f, camera_to_world=pose_of[f.id]) for f in world.capture.frames if f.id in pose_of)
    world.capture = replace(world.capture, frames=posed)
    turned, moved = (
        max(float(np.sqrt(v)) for name, v in zip(joint["parameters"], np.diag(joint["covariance"]), strict=True)
            if name.startswith(what))
        for what in ("turn", "move")
    )  # fmt: skip
    line = (
        f"poses: {len(group)} views of one scene, {1e3 * estimate.distance_m:.2f} mm from each other's planes in the "
        f"median; +- {1e3 * _Z90 * moved:.2f} mm, {np.degrees(_Z90 * turned):.3f} degrees (90 %)"
    )
    if others:
        line += f"; frames {', '.join(map(str, others))} show other scenes and tell of camera and pattern alone"
    world.note("poses", {"frames": list(pose_of), "joint": joint, "distance_m": estimate.distance_m}, line)


def _moves(world: World, overlap: Overlap) -> ValueError:
    a, b = (world.views[i].frame.id for i in (overlap.a, overlap.b))
    return ValueError(
        f"{world.where}: the scene moves: {100 * (1 - overlap.on):.0f} % of what frames {a} and {b} both see lies "
        "elsewhere: record a static scene, or leave one of them out"
    )


def _poses_joint(estimate: PoseEstimate, frames: Sequence[int], camera: Any, f_px: float) -> dict[str, Any]:
    """Returns the joint covariance of focal length, centre and poses, each pose in its own camera's axes. camera:
    covariance of (f, cx, cy), None if they are nominal. An error of the camera also changes the poses."""
    by_camera, own = np.vstack([np.eye(3), estimate.by_camera]), np.zeros((3, 3)) if camera is None else camera
    covariance = by_camera @ own @ by_camera.T
    covariance[3:, 3:] += estimate.covariance
    names, to_own = ["focal length", "cx", "cy"], np.diag(np.r_[1.0 / f_px, np.ones(len(covariance) - 1)])
    for k, (frame, pose) in enumerate(zip(frames, estimate.view_to_world, strict=True)):
        names += [f"{what} {axis} {frame}" for what in ("turn", "move") for axis in "xyz"]
        turn, at = pose[:3, :3].T, slice(3 + 6 * k, 9 + 6 * k)
        # A rotation w about the world's origin moves the camera by w x t.
        to_own[at, at] = np.block([[turn, np.zeros((3, 3))], [turn @ np.cross(np.eye(3), pose[:3, 3]).T, turn]])
    return block(names, to_own @ covariance @ to_own.T)


def _turn(pose: NDArray[np.float64], distance_m: float) -> float:
    """Returns the angle, rad, by which a camera motion changes the direction of a point at distance_m: the rotation's
    angle plus translation over distance. pose: the motion, 4x4."""
    turn = np.arccos(np.clip(0.5 * (np.trace(pose[:3, :3]) - 1.0), -1.0, 1.0))
    return float(turn + np.linalg.norm(pose[:3, 3]) / distance_m)


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
    projector = replace(rig.projector, K=dots.K, left_to_projector=rigid_motion(-dots.place))
    world.capture = replace(world.capture, rig=replace(rig, projector=projector))
    sd = _Z90 * 1e3 * np.sqrt(np.diag(dots.covariance))
    place = ", ".join(f"{1e3 * x:.2f} +- {s:.2f}" for x, s in zip(dots.place, sd, strict=True))
    values = {
        "place_m": dots.place.tolist(),
        "joint": block(("projector x", "projector y", "projector z"), dots.covariance),
        "left_out_r": {str(k): round(v, 4) for k, v in dots.r.items()},
        "is_common": dots.is_common,
    }
    line = f"pattern: the views share no dots (r {dots.r_median():.2f} in the median): each view's own stand in, at "
    line += "the projector's stated place"
    if dots.is_common:
        line = f"pattern: projector at ({place}) mm in the left camera's frame (90 %); each view's dots correlate "
        line += f"{dots.r_median():.2f} in the median ({min(dots.r.values()):.2f} to {max(dots.r.values()):.2f}) with "
        line += "what the others predict"
    world.note("pattern", values, line)


def _exposure(world: World, seed: int, folder: Path, progress: Progress) -> None:
    """Measures each frame's exposure, the black level and the lens's falloff from places in several views."""
    views, poses = world.scene_views()
    train = _train(world)
    given = world.capture.rig.black_dn if "exposure" not in world.capture.measured else None
    own = [view for view in world.views if view.frame.split == "train"]
    believed = given or black_level(own)
    response = response_of(own, world.capture.rig.max_dn) if "exposure" not in world.capture.measured else None
    if response is not None and abs(response[0]) < LINEAR and given is None:
        believed = response[1], BLACK_BY_EXPOSURES_DN
    lights = [light_view(view, world.K, world.projected()) for view in views]
    estimate = solve_light([lights[k] for k in train], [poses[k] for k in train], world.K, believed)
    if given is not None:
        estimate = replace(estimate, black_dn=given)
    exposure, deviation = (
        dict(zip(train, values, strict=True)) for values in (estimate.exposure, estimate.exposure_deviation)
    )
    for k in (k for k in range(len(views)) if k not in exposure):
        both = solve_light([lights[train[0]], lights[k]], [poses[train[0]], poses[k]], world.K, believed, estimate)
        exposure[k], deviation[k] = float(both.exposure[1]), float(both.exposure_deviation[1])
    first = views[train[0]].frame.exposure_s
    times = {views[k].frame.id: first * e for k, e in exposure.items()}
    frames = tuple(replace(f, exposure_s=times.get(f.id, f.exposure_s)) for f in world.capture.frames)
    rig = replace(world.capture.rig, black_dn=estimate.black_dn)
    known = [sd / exposure[k] for k, sd in deviation.items() if np.isfinite(sd) and sd > 0]
    uncertainty = replace(world.capture.uncertainty, exposure=max(float(np.max(known, initial=0.0)), _LEAST_EXPOSURE))
    world.capture = replace(world.capture, frames=frames, rig=rig, uncertainty=uncertainty)
    values = {
        "black_dn": list(estimate.black_dn),
        "exposure_s": {str(frame): time for frame, time in times.items()},
        "relative_deviation": {
            str(views[k].frame.id): float(sd / exposure[k]) if np.isfinite(sd) else None for k, sd in deviation.items()
        },
        "response_log_exponent": None if response is None else response[0],
        "vignetting_exponent": None if estimate.exponent is None else list(estimate.exponent),
        "log_scatter": list(estimate.scatter) if np.isfinite(estimate.scatter[0]) else None,
    }
    if estimate.covariance is not None:
        further = [f"exposure {views[k].frame.id}" for k in train[1:]]
        values["joint"] = block([*further, "falloff", "black"], estimate.covariance)
    shares = ", ".join(f"{frame}: {time / first:.3f}" for frame, time in times.items())
    line = f"exposure: {shares}; black level {estimate.black_dn[0]:.2f} +- {_Z90 * estimate.black_dn[1]:.2f} DN; "
    if estimate.exponent is None:
        line += "no overlaps: the lens's falloff cannot be told from the surfaces"
    else:
        n, sd = estimate.exponent
        line += f"in overlaps light falls as cos^{n:.2f} +- {_Z90 * sd:.2f} of the angle (90 %): log-ratios scatter by "
        line += f"{estimate.scatter[0]:.3f} without, {estimate.scatter[1]:.3f} with"
    world.note("exposure", values, line)
    if len(train) > 1:
        own = [views[k] for k in train]
        world.pictures["exposure"] = exposure_picture(own, [poses[k] for k in train], world.K, estimate)


def _albedo(world: World, seed: int, folder: Path, progress: Progress) -> None:
    """Makes the scene: each view's surface with its albedo and the room's light, without exposure and falloff."""
    views, poses = world.scene_views()
    train, measured = _train(world), world.capture.measured.get("exposure", {})
    exponent = measured.get("vignetting_exponent")
    times = {frame.id: frame.exposure_s for frame in world.capture.frames}
    own = [views[k] for k in train]
    relative = np.array([times[view.frame.id] for view in own])
    estimate = LightEstimate(
        relative / relative[0], np.zeros(len(own)), world.capture.rig.black_dn or black_level(own),
        None if exponent is None else (float(exponent[0]), float(exponent[1])), (np.nan, np.nan),
    )  # fmt: skip
    lights = [light_view(view, world.K, world.projected()) for view in own]
    textures = []
    for done in range(len(train)):
        textures.append(merged_textures(done, lights, [poses[j] for j in train], estimate, world.K))
        progress((done + 1) / len(train) * 0.7)
    scene = folder / "scene.glb"
    triangles = write_scene(scene, own, [poses[k] for k in train], textures, world.capture.rig.left)
    world.capture = replace(world.capture, scene_path=scene)
    world.masks = known_masks(views, poses, [k in train for k in range(len(views))], world.capture.rig)
    world.pictures |= scene_pictures(views, world.masks, textures)
    share = float(np.mean([mask.mean() for mask in world.masks.values()]))
    spread = np.concatenate([t.deviation[np.isfinite(t.deviation)][::37] for t in textures])
    deviation = float(np.median(spread)) if spread.size else None
    values: dict[str, Any] = {"room_relative_deviation": deviation, "known_share": share}
    line = f"albedo: {triangles} triangles under albedo and room light; predicted by other views in {100 * share:.0f} %"
    if deviation is not None:
        line += f" of the images, where views differ by {100 * deviation:.1f} % in the median"
    world.note("albedo", values, line)


def _train(world: World) -> list[int]:
    """Returns the indices of those views of the scene that are for training, not held out for the test."""
    views, _ = world.scene_views()
    split = {frame.id: frame.split for frame in world.capture.frames}
    train = [k for k, view in enumerate(views) if split[view.frame.id] == "train"]
    if not train:
        raise ValueError(f"{world.where}: every view of the scene is held out: leave some to measure its light on")
    return train


# {step: (function, where its share of the progress begins, where it ends)}, in order.
STEPS: dict[str, tuple[Callable[[World, int, Path, Progress], None], float, float]] = {
    "camera": (_camera, 0.35, 0.45),
    "poses": (_poses, 0.45, 0.5),
    "pattern": (_pattern, 0.5, 0.85),
    "exposure": (_exposure, 0.85, 0.9),
    "albedo": (_albedo, 0.9, 1.0),
}


def _write(world: World, out: Path, folder: Path) -> None:
    capture, whole = world.capture, read_capture(world.capture.path)
    dtype = np.uint8 if capture.rig.bit_depth <= 8 else np.uint16
    frames = [f for f in capture.frames if f.has_infrared]
    images = {(f.id, side): whole.ir(f, side).astype(dtype) for f in frames for side in SIDES}
    known = {(f.id, side): mask for f in frames for side in SIDES if (mask := whole.known(f, side)) is not None}
    depths, colors = {}, {}
    for frame in capture.frames:
        depth, color = whole.depth(frame), whole.color(frame)
        if depth is not None and frame.depth_scale is not None:
            depths[frame.id] = np.rint(depth / frame.depth_scale).astype(np.uint16)
        if color is not None:
            colors[frame.id] = color
    write_capture(out, replace(capture, name=out.name), images, world.pattern, depths, colors, known | world.masks)
    (out / "measured").mkdir()
    for name, picture in world.pictures.items():
        write_png(out / "measured" / f"{name}.png", picture)
