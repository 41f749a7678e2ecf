# SPDX-License-Identifier: Apache-2.0
"""Worlds that stand for reality, in which a policy is tried: the same task as another camera sees it."""

import importlib.util

import cv2
import numpy as np

from activestereo.sensor.depth_modes import DepthCamera
from sim_to_real.foreign_mitsuba import foreign_room, foreign_things
from sim_to_real.mitsuba_camera import MitsubaCamera
from sim_to_real.sgbm import Sgbm
from stereo_grasp import GraspWorld
from stereo_grasp.world import CAMERA_ON_GRIPPER
from activestereo.common.pose import Pose
from activestereo.camera.plan import plan_of
from activestereo.camera.plan import registered

RENDERERS = ("ours", "mitsuba")
MITSUBA_SAMPLES = 4  # rays per pixel of the dots, and as many of the room


class ForeignCamera:
    """The same place, other figures: a darker exposure, other noise, and OpenCV's StereoSGBM in place of our
    matcher."""

    def __init__(self, camera: DepthCamera) -> None:
        self._sensors, self._config = camera.sensors, camera.sensors.get_config()
        self._plan = plan_of(self._config)
        count = -(-self._config.max_disparity // 16) * 16
        self._matcher = cv2.StereoSGBM_create(0, count, 5, 8 * 25, 32 * 25, 1, 0, 5, 60, 2, cv2.STEREO_SGBM_MODE_HH4)
        self._border = count

    def take(self) -> np.ndarray:
        self._sensors.take_picture(infrared_only=True)
        self._sensors.compute_depth()
        pairs = zip(*self._sensors.get_ir_measured(), strict=True)
        return np.stack([self._depth(left, right) for left, right in pairs])

    def seed(self, seed: int) -> None:
        self._sensors.restart(seed)

    def _depth(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        wide = [cv2.copyMakeBorder(i, 0, 0, self._border, 0, cv2.BORDER_REPLICATE) for i in (left, right)]
        disparity = self._matcher.compute(*wide)[:, self._border :].astype(np.float32) / 16.0
        depth = np.where(disparity > 0.5, self._config.focal_baseline_px_m / np.maximum(disparity, 0.5), 0.0)
        depth = depth.astype(np.float32)
        return registered(depth, self._config.ir_intrinsic, np.eye(4), self._plan)


class MitsubaWrist:
    """Images of Mitsuba 3 with its materials, light, optics and noise (the table in
    tests/bench/sim_to_real/foreign_mitsuba.py says what differs), and OpenCV's StereoSGBM."""

    def __init__(self, world: GraspWorld) -> None:
        self._world, config = world, world.camera.sensors.get_config()
        self._camera, self._matcher = MitsubaCamera(config, MITSUBA_SAMPLES), Sgbm(config)
        self.infrared = np.zeros((world.count, config.ir_resolution[1], config.ir_resolution[0]), np.uint8)
        self.seed(config.noise_seed)

    def seed(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)

    def take(self) -> np.ndarray:
        return np.stack([self._depth(environment) for environment in range(self._world.count)])

    def _depth(self, environment: int) -> np.ndarray:
        things, number = self._world.things, self._world.chosen[environment]
        gripper = self._world.mounts.poses[environment]
        body = Pose(gripper[:3], gripper[3:]) * CAMERA_ON_GRIPPER
        shown = foreign_things(
            things.mesh(environment, number), things.materials[environment][number], environment,
            things.thing_to_world[environment], body.p,
        )  # fmt: skip
        light = self._camera.light(shown, foreign_room(), body, self._random)
        left, right = self._camera.counts(light, self._random)
        self.infrared[environment] = left
        return self._matcher.depth(left, right)


def foreign_renderers() -> list[str]:
    """Returns those of RENDERERS that are installed, and tells of those that are not."""
    if importlib.util.find_spec("mitsuba"):
        return list(RENDERERS)
    print("the foreign world of Mitsuba is left out: it needs the package mitsuba (pip install mitsuba)")
    return ["ours"]


def foreign_world(environments: int, seed: int, things: str, renderer: str = "ours") -> GraspWorld:
    """renderer: of RENDERERS. ValueError without the package that it needs."""
    world = GraspWorld(environments, "full", seed=seed, things=things)
    if renderer == "mitsuba":
        world.camera = MitsubaWrist(world)
        return world
    config = world.camera.sensors.get_config()
    config.ir_speckle_noise, config.ir_thermal_noise, config.ir_camera_exposure = 4.0, 6.0, 0.003
    config.max_bounces = 6
    world.camera = ForeignCamera(DepthCamera("full", config, world.mounts, CAMERA_ON_GRIPPER))
    return world
