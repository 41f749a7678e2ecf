# SPDX-License-Identifier: Apache-2.0
"""Grasping with a depth camera on the wrist, without physics: a gripper that looks down moves in ten steps to a thing
on a table, closes and lifts. What a grasp needs is geometry here: fingers beside the thing and not on it, square to its
sides, deep enough. Needs no package beyond the sensor's own.

Gripper axes: x along the fingers' width, y the way they close, z up; its origin is between the finger tips.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import kuafu
from stereo_grasp.scene import OBJECTS, GraspScene
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import body_pose, look_at
from activestereo.sensor.depth_modes import DepthCamera, IsaacSettings
from activestereo.sensor.mounts import Mounts

STEPS = 10
# What an action of 1 moves: x, y, z in metres, and the turn about z in radians.
STEP_SCALE = np.array([0.03, 0.03, 0.04, 0.3])
_OPENING_M = 0.08
_FINGER_HALF_WIDTH_M = 0.01
_LARGEST_TILT_RAD = np.deg2rad(20.0)  # a finger pad slips on a side that is turned farther: friction of 0.36
_LEAST_DEPTH_M = 0.01
_START_M, _START_SPREAD_M, _OBJECT_SPREAD_M = 0.2, 0.02, 0.07
# The RGB camera's pose on the gripper: it looks at the finger tips.
CAMERA_ON_GRIPPER = body_pose(look_at((-0.06, 0.0, 0.24), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
_FIELD_OF_VIEW_RAD, _NEAREST_M = np.deg2rad(58.0), 0.12
# By default it sees nothing nearer than 0.5 m and no surface without texture: on a wrist, nothing.
_ISAAC = IsaacSettings(min_distance_m=_NEAREST_M, needs_texture=False)


class GraspWorld:
    """E environments side by side. mode: one of depth_modes.MODES. size_px: of the square depth images. things: "mixed"
    ones of clay, plastic, steel and rubber, or "hard" ones of glass, polished steel and black velvet. Deterministic
    under a seed."""

    def __init__(
        self,
        environment_count: int = 1,
        mode: str = "full",
        size_px: int = 64,
        samples_per_pixel: int = 4,
        seed: int = 0,
        device: str | int | kuafu.Device = "auto",
        things: str = "mixed",
    ) -> None:
        self.count = environment_count
        self._random = np.random.default_rng(seed)
        self.things = GraspScene(environment_count, self._random, device, things)
        self.gripper_m = np.zeros((environment_count, 3))
        self.yaw_rad = np.zeros(environment_count)
        self.chosen = np.zeros(environment_count, np.intp)
        self.object_m = np.zeros((environment_count, 2))
        self.object_yaw_rad = np.zeros(environment_count)
        self.steps = np.zeros(environment_count, np.intp)
        self.mounts = Mounts(self.things.scene, self._poses())
        config = wrist_config(size_px, samples_per_pixel, seed)
        self.camera = DepthCamera(mode, config, self.mounts, CAMERA_ON_GRIPPER, isaac=_ISAAC)

    def reset(self, which: NDArray[np.bool_] | None = None, seed: int | None = None) -> NDArray[np.float32]:
        """Begins again in all environments, or in those of `which` [E]; returns the depth."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
            self.camera.seed(seed)
        e = np.ones(self.count, bool) if which is None else np.asarray(which, bool)
        # Drawn for all, so that one environment's course does not depend on when others begin again.
        draws = self._random.uniform(-1.0, 1.0, (self.count, 7))
        self.chosen[e] = self._random.integers(OBJECTS, size=self.count)[e]
        self.object_m[e] = _OBJECT_SPREAD_M * draws[e, :2]
        self.object_yaw_rad[e] = np.pi * draws[e, 2]
        self.gripper_m[e] = _START_SPREAD_M * draws[e, 3:6] + [0.0, 0.0, _START_M]
        self.yaw_rad[e] = 0.3 * draws[e, 6]
        self.steps[e] = 0
        self.things.place(self.chosen, self.object_m, self.object_yaw_rad)
        return self.look()

    def step(self, actions: NDArray[np.floating]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """actions: [E, 4] in -1..1 (dx, dy, dz, dtheta in the gripper's axes). Returns (ended [E], succeeded [E]):
        after STEPS steps the gripper closes and lifts. ValueError, and nothing has moved, for what is no action."""
        actions = np.asarray(actions, np.float64)
        if actions.shape != (self.count, 4):
            raise ValueError(f"actions of {self.count} environments are [{self.count}, 4], not {actions.shape}")
        broken = np.flatnonzero(~np.isfinite(actions).all(axis=1))
        if broken.size:
            raise ValueError(f"environment {broken[0]}: its action {actions[broken[0]]} is not finite")
        move = np.clip(actions, -1.0, 1.0) * STEP_SCALE
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        self.gripper_m += np.stack(
            [cos * move[:, 0] - sin * move[:, 1], sin * move[:, 0] + cos * move[:, 1], move[:, 2]], axis=1
        )
        self.gripper_m[:, 2] = np.maximum(self.gripper_m[:, 2], 0.0)
        self.yaw_rad += move[:, 3]
        self.steps += 1
        ended = self.steps >= STEPS
        return ended, ended & self.would_hold()

    def look(self) -> NDArray[np.float32]:
        """Depth [E, size, size] of the wrist cameras, metres."""
        self.mounts.poses = self._poses()
        return self.camera.take_depth()

    def offsets(self) -> NDArray[np.float64]:
        """[E, 4]: how far the gripper is from where it should close, in its own axes: x, y, z and the turn."""
        half = self.half_sizes_m
        rel = self.object_m - self.gripper_m[:, :2]
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, y = cos * rel[:, 0] + sin * rel[:, 1], -sin * rel[:, 0] + cos * rel[:, 1]
        z = np.maximum(2.0 * half[:, 2] - 0.025, 0.002) - self.gripper_m[:, 2]
        # A box is held across its narrow side, which is its x.
        turn = self.object_yaw_rad + np.pi / 2 - self.yaw_rad
        turn = np.where(self.is_round, 0.0, (turn + np.pi / 2) % np.pi - np.pi / 2)
        return np.stack([x, y, z, turn], axis=1)

    def would_hold(self) -> NDArray[np.bool_]:
        """[E]: whether closing now would lift the thing."""
        x, y, _, turn = self.offsets().T
        half = self.half_sizes_m
        width = np.where(
            self.is_round, half[:, 0], half[:, 0] * np.abs(np.cos(turn)) + half[:, 1] * np.abs(np.sin(turn))
        )
        fits = np.abs(y) + width < _OPENING_M / 2
        reach = np.where(self.is_round, half[:, 0], half[:, 1])
        is_between = np.abs(x) < reach - 0.5 * _FINGER_HALF_WIDTH_M
        is_deep = 2.0 * half[:, 2] - self.gripper_m[:, 2] > _LEAST_DEPTH_M
        return np.asarray(fits & is_between & is_deep & (np.abs(turn) < _LARGEST_TILT_RAD))

    @property
    def half_sizes_m(self) -> NDArray[np.float64]:
        """[E, 3] of the thing on the table."""
        return np.asarray(self.things.half_sizes_m[np.arange(self.count), self.chosen])

    @property
    def is_round(self) -> NDArray[np.bool_]:
        """[E] of the thing on the table."""
        return np.asarray(self.things.is_round[self.chosen])

    def _poses(self) -> NDArray[np.float64]:
        poses = np.zeros((self.count, 7))
        poses[:, :3] = self.gripper_m
        poses[:, 3], poses[:, 6] = np.cos(0.5 * self.yaw_rad), np.sin(0.5 * self.yaw_rad)
        return poses


def teacher(world: GraspWorld) -> NDArray[np.float64]:
    """[E, 4]: the action of one who knows the state."""
    return np.clip(world.offsets() / STEP_SCALE, -1.0, 1.0)


def wrist_config(size_px: int, samples_per_pixel: int, seed: int) -> StereoDepthSensorConfig:
    """A small D435 for near things, of 58 degrees, its exposure fixed. The infrared images are of twice the size of the
    depth: the matcher's windows would blur a thing of 10 pixels away."""
    config = StereoDepthSensorConfig("sapien-D435")
    config.rgb_resolution, config.rgb_intrinsic = (size_px, size_px), _intrinsic(size_px)
    config.ir_resolution, config.ir_intrinsic = (2 * size_px, 2 * size_px), _intrinsic(2 * size_px)
    config.min_depth_m, config.max_depth_m = 0.1, 1.0
    config.max_disparity = max(32, int(np.ceil(config.focal_baseline_px_m / _NEAREST_M)))
    config.block_width = config.block_height = 3
    config.p1, config.p2 = 4, 16
    config.ir_camera_exposure = 0.004
    config.light_pattern_scale = 128.0 / size_px  # dots of more than a pixel
    config.samples_per_pixel, config.max_bounces = samples_per_pixel, 3
    config.noise_seed = config.render_seed = seed
    return config


def _intrinsic(size_px: int) -> NDArray[np.float64]:
    focal, middle = 0.5 * size_px / np.tan(0.5 * _FIELD_OF_VIEW_RAD), 0.5 * (size_px - 1)
    return np.array([[focal, 0.0, middle], [0.0, focal, middle], [0.0, 0.0, 1.0]])
