# SPDX-License-Identifier: Apache-2.0
"""Reads real views (an infrared pair, the device's depth, the scene) and simulates their depth by nine methods."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import Capture, Frame
from activestereo.capture.images import read_gray
from activestereo.common.pose import CAMERA_TO_BODY, Pose, body_pose
from activestereo.effects.core.room_light import RoomLight, has_room_light, light_by_room
from activestereo.scene_io.scene_files import load_scene_file
from activestereo.sensor.depth_modes import make_lambertian
from activestereo.sensor.rival_noise import OF_TRUTH, one_view_depth
from activestereo.sensor.sensor import StereoDepthSensor

Map = NDArray[np.float32]


@dataclass(frozen=True)
class RealView:
    """A recorded view. left, right: infrared images, DN. device_m, truth_m: depth in the left camera, by the device and
    by the scene's model, metres; 0 = none. room: the room's light as measured on the surfaces, None if the scene has
    lights of its own."""

    name: str
    capture: Capture
    frame: Frame
    left: Map
    right: Map
    device_m: Map
    truth_m: Map
    scene: kuafu.Scene
    room: RoomLight | None = None

    @property
    def focal_baseline_px_m(self) -> float:
        return float(self.capture.rig.left.K[0, 0]) * self.capture.rig.baseline_m

    def disparity(self, depth_m: Map) -> Map:
        """Converts depth in metres to disparity in pixels, NaN without depth."""
        with np.errstate(divide="ignore"):
            return np.where(depth_m > 0, self.focal_baseline_px_m / depth_m, np.float32(np.nan)).astype(np.float32)


def real_views(capture: Capture, device_depth: Path | None, device: str | int) -> list[RealView]:
    """Reads the views of a capture that have a pair and depth. device_depth: a folder with the device's 16-bit PNG
    files in millimetres, in order of the frames, for a capture whose own depth is a better instrument's; None: the
    capture's own depth. Raises ValueError if the counts differ."""
    frames = [frame for frame in capture.frames if frame.has_infrared]
    files: list[Path] | None = None
    if device_depth is not None:
        files = sorted(device_depth.glob("*.png"))
        if len(files) != len(frames):
            raise ValueError(f"{device_depth}: has {len(files)} PNG files, {capture.path} {len(frames)} pairs")
    scene = kuafu.Scene(kuafu.Device(device))
    load_scene_file(scene, capture.scene_path)
    has_room = has_room_light(capture.scene_path)
    room = light_by_room(scene, scene.device, capture.scene_path) if has_room else None
    renderer, views = kuafu.Renderer(scene.device), []
    camera = capture.rig.left
    for number, frame in enumerate(frames):
        if files is not None:
            depth = read_gray(files[number], (camera.width, camera.height), "depth").astype(np.float32) * 1e-3
        else:
            found = capture.depth(frame)
            if found is None:
                continue
            depth = found.astype(np.float32)
        eye = kuafu.Camera(camera.width, camera.height, camera.K, frame.camera_to_world)
        truth = renderer.render(scene, eye, ["depth"], band="infrared", spp=1)["depth"].reshape(depth.shape)
        left, right = (capture.ir(frame, side) for side in ("left", "right"))
        name = f"{capture.path.name} {frame.id}"
        depth_m = np.nan_to_num(depth)
        views.append(RealView(name, capture, frame, left, right, depth_m, np.array(truth), scene, room))
    if not views:
        raise ValueError(f"{capture.path}: has no frame with an infrared pair and depth")
    return views


OF_PAIRS = ("raster", "preset", "calibrated")
METHODS = (*OF_TRUTH, *OF_PAIRS)
_FIT_STEP_PX = 7  # the fit of the light's two levels takes every seventh row and column


@dataclass(frozen=True)
class Simulated:
    """A method's simulation of a real view. depth_m: its depth in the left camera, metres, in two exposures that differ
    only by noise. left, right: infrared images, DN; None for methods without a pair."""

    depth_m: tuple[Map, Map]
    left: Map | None = None
    right: Map | None = None


def simulated(view: RealView, method: str, sensor: str, samples: int, seed: int) -> Simulated:
    """Simulates a real view by a method of METHODS. sensor: a preset's name; samples: samples per pixel. 'raster' makes
    the scene's materials Lambertian for good: take it last."""
    if method in OF_TRUTH:
        gray, lens = (view.left / view.capture.rig.max_dn)[None], float(view.capture.rig.left.K[0, 0])
        randoms = (np.random.default_rng(seed + number) for number in range(2))
        truth, focal_baseline = view.truth_m[None], view.focal_baseline_px_m
        first, second = (one_view_depth(method, truth, gray, lens, focal_baseline, own)[0] for own in randoms)
        return Simulated((first, second))
    config = rig_config(view, sensor, method == "calibrated")
    config.samples_per_pixel, config.noise_seed = samples, seed
    if method == "raster":
        make_lambertian(view.scene)
        config.max_bounces = 0
    place = Pose(body_pose(view.frame.camera_to_world).to_transformation_matrix())
    with StereoDepthSensor(config, view.scene, pose=place) as taken:
        taken.take_picture(infrared_only=True)
        light, laser = fitted_light(view, taken)
        wanted = ("depth", "ir_left", "ir_right")
        found = [taken.compute_depth_from(light[0], light[1], laser[0], laser[1], wanted, frame) for frame in range(2)]
    depths = [np.array(one["depth"], np.float32) for one in found]
    pair = (np.array(found[0][f"ir_{side}"], np.float32) for side in ("left", "right"))
    return Simulated((depths[0], depths[1]), *pair)


def rig_config(view: RealView, sensor: str, is_calibrated: bool) -> StereoDepthSensorConfig:
    """Returns the preset with the capture's cameras; is_calibrated: also with its projector, pattern, black level and
    vignetting."""
    rig, config = view.capture.rig, StereoDepthSensorConfig(sensor).seen_from_left()
    config.ir_resolution = (rig.left.width, rig.left.height)
    config.ir_intrinsic = np.array(rig.left.K)
    beside = np.eye(4)
    beside[1, 3] = -rig.baseline_m
    config.trans_pose_r = Pose(beside)
    config.max_depth_m = float("inf")
    config.ir_exposure_mode = "fixed"  # the light is fitted to the real image's
    if view.room is not None:  # measured with all its bounces, and without noise
        config.max_bounces, config.denoise = 1, "none"
    if not is_calibrated:
        return config
    there = CAMERA_TO_BODY @ np.linalg.inv(rig.projector.left_to_projector) @ CAMERA_TO_BODY.T
    config.pose_rgb_irproj = Pose(there)
    config.pattern_intrinsic = np.array(rig.projector.K)
    config.light_pattern = np.rint(255.0 * rig.projector.pattern()).astype(np.uint8)
    # The calibrated pattern is already blurred by the camera's lens, so neither beam nor lens blurs it again.
    config.projector_beam_radius_m = 0.0
    config.ir_optics = {name: value for name, value in (config.ir_optics or {}).items() if name != "psf_sigma_px"}
    if rig.black_dn is not None:
        config.ir_black_level_dn = rig.black_dn[0]
    exposure = view.capture.measured.get("exposure", view.capture.measured.get("light", {}))
    if "vignetting_exponent" in exposure:
        config.ir_optics["vignetting_exponent"] = exposure["vignetting_exponent"][0]
    return config


def fitted_light(view: RealView, taken: StereoDepthSensor) -> tuple[list[Map], list[Map]]:
    """Renders radiance for both cameras, with levels of laser and room light fitted to the real left image, since a
    preset knows neither. Returns ([left, right] radiance, [left, right] of the laser's part alone), [height, width]
    W/(sr m^2)."""
    config = taken.get_config()
    per_radiance = config.ir_camera_exposure * config.ir_camera_gain * config.ir_responsivity_dn
    laser = [
        taken.get_picture("projector_direct", side)[..., 0] + taken.get_picture("projector_indirect", side)[..., 0]
        for side in ("left", "right")
    ]
    if view.room is not None:
        renderer, options = kuafu.Renderer(view.scene.device), {"spp": config.samples_per_pixel}
        room = [image[..., 0] for image in view.room.images(renderer, list(taken.ir_cameras()), **options)]
    else:
        sides = zip(("left", "right"), laser, strict=True)
        room = [taken.get_picture("radiance", side)[..., 0] - own for side, own in sides]
    part = np.s_[::_FIT_STEP_PX, ::_FIT_STEP_PX]
    known = (view.truth_m > 0)[part] & (view.left < view.capture.rig.max_dn)[part]
    terms = np.stack([laser[0][part][known], room[0][part][known]], axis=1).astype(np.float64) * per_radiance
    counts = view.left[part][known].astype(np.float64) - config.ir_black_level_dn
    weights, levels = np.ones(len(counts)), np.zeros(2)
    for _ in range(10):  # least squares of factors, all at least 0, with Huber's weights
        root = np.sqrt(weights)
        levels = np.maximum(np.linalg.lstsq(terms * root[:, None], counts * root, rcond=None)[0], 0.0)
        error = np.abs(counts - terms @ levels)
        weights = np.minimum(1.0, 1.5 * np.median(error) / np.maximum(error, 1e-9))
    own = [(levels[0] * one).astype(np.float32) for one in laser]
    return [one + (levels[1] * rest).astype(np.float32) for one, rest in zip(own, room, strict=True)], own
