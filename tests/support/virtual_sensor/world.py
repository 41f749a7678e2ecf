# SPDX-License-Identifier: Apache-2.0
"""Draws and records a small table-top world: solids, pattern, poses, exposures and noise."""

from dataclasses import dataclass

import numpy as np

from activestereo.capture.capture import Camera, Capture, Frame, Projector, Rig
from activestereo.capture.write import write_capture
from activestereo.common.pose import rigid_motion
from virtual_sensor.gltf import write_gltf
from virtual_sensor.held_out.rig import look_at
from virtual_sensor.pcg import Pcg
from virtual_sensor.sensor import Sensor, expose
from virtual_sensor.solids import Box, Rectangle, Sphere
from virtual_sensor.view import PatternSource, look

BASELINE_M = 0.05
PROJECTOR_X_M = 0.015


@dataclass(frozen=True)
class World:
    """A recorded world with the truth to find. views: noise-free images, {(frame id, side): View}."""

    capture_path: object
    sensor: Sensor
    solids: tuple
    views: dict


def table_top():
    """Returns the scene's solids: table, wall, ball and box; y is up, and the camera looks along -z from above."""
    return (
        Rectangle("table", (0.0, 0.0, -0.1), (0.0, 0.0, 0.7), (0.9, 0.0, 0.0), 0.45),
        Rectangle("wall", (0.0, 0.4, -0.6), (0.9, 0.0, 0.0), (0.0, 0.5, 0.0), 0.6),
        Sphere("ball", (0.12, 0.11, -0.2), 0.11, 0.75),
        Box("box", (-0.2, 0.08, -0.25), (0.09, 0.08, 0.07), 0.4, 0.3),
    )


def dot_pattern(width, height, dots, seed):
    """Draws a uint8 image of round Gaussian dots of varied strength on a dark ground."""
    rng = Pcg(dots, seed)
    u, v, strength = rng.uniform() * width, rng.uniform() * height, 0.4 + 0.6 * rng.uniform()
    columns, rows = np.arange(width)[None], np.arange(height)[:, None]
    image = np.full((height, width), 0.02)
    for x, y, s in zip(u, v, strength, strict=True):
        image += s * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 6.0)
    return np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)


def make_world(folder, seed=1, size=(106, 60), sensor=None, grid=4, bounces=1):
    """Records the table-top as a capture in folder/capture and returns its World. There are two train poses and one
    test pose, each recorded twice. One more frame has no projector light, and one has half the exposure."""
    sensor = sensor or Sensor(projector_scale=9.0e4, ambient_scale=3.0e3)
    folder.mkdir(parents=True, exist_ok=True)
    solids = table_top()
    scene_path = write_gltf(folder, solids)
    pattern = dot_pattern(320, 200, 900, seed)
    rig = _rig(size, folder / "pattern.png")
    poses = [look_at(eye, (0.0, 0.08, -0.2)) for eye in ((0.0, 0.4, 0.5), (-0.25, 0.35, 0.4), (0.2, 0.45, 0.45))]
    plan = [  # pose, exposure_s, projector power, repeat group, split
        (0, 0.004, 1.0, 0, "train"), (0, 0.004, 1.0, 0, "train"), (1, 0.004, 1.0, 1, "train"),
        (1, 0.004, 1.0, 1, "train"),
        (2, 0.004, 1.0, 2, "test"), (2, 0.004, 1.0, 2, "test"), (0, 0.004, 0.0, None, "train"),
        (1, 0.002, 1.0, None, "test"),
    ]  # fmt: skip
    frames, images, views, by_pose = [], {}, {}, {}
    for i, (pose, exposure, power, group, split) in enumerate(plan):
        more = {"projector_power": power, "repeat_group": group}
        frames.append(Frame(i, None, None, 0.1 * i, exposure, poses[pose], split, **more))
        for e, side in enumerate(("left", "right")):
            if (pose, side) not in by_pose:
                by_pose[pose, side] = see(
                    solids, rig, pattern, poses[pose], side, 1000 * seed + 2 * pose + e, grid, bounces
                )
            views[i, side] = by_pose[pose, side]
            images[i, side] = expose(sensor, views[i, side], exposure, power, seed=7919 * seed + 2 * i + e)
    capture = Capture(folder, f"world-{seed}", scene_path, rig, tuple(frames))
    write_capture(folder / "capture", capture, images, pattern)
    return World(folder / "capture", sensor, solids, views)


def see(solids, rig, pattern, left_to_world, side, seed, grid, bounces):
    """Renders one camera's View. left_to_world: the rig's pose, 4x4; side: "left" or "right"."""
    camera = rig.camera(side)
    camera_to_world = left_to_world if side == "left" else left_to_world @ np.linalg.inv(rig.left_to_right)
    source_pose = left_to_world @ np.linalg.inv(rig.projector.left_to_projector)
    source = PatternSource(source_pose[:3, 3], source_pose[:3, :3], rig.projector.K, pattern / 255.0)
    return look(solids, (camera.width, camera.height), camera.K, camera_to_world, source, seed, grid, bounces)


def _rig(size, pattern_path):
    width, height = size
    focal = 0.5 * width
    camera = Camera(width, height, np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]]))
    source_K = np.array([[148.0, 0, 159.5], [0, 148.0, 99.5], [0, 0, 1.0]])
    left_to_right, left_to_projector = rigid_motion((-BASELINE_M, 0, 0)), rigid_motion((-PROJECTOR_X_M, 0, 0))
    return Rig(camera, camera, left_to_right, Projector(pattern_path, source_K, left_to_projector))
