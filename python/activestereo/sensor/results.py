# SPDX-License-Identifier: Apache-2.0
"""Results of sensors' last pictures: images, depth maps, and calibrated cameras."""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.auto_exposure import rgb_exposure, srgb
from activestereo.camera.config_limits import DEPTH_MAPS
from activestereo.camera.plan import ir_intrinsics, matcher_parameters
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import DEPTH_ENGINE, SIDES
from activestereo.common.computed_once import computed_once
from activestereo.common.lens import to_tangents
from activestereo.common.pose import Pose, camera_to_camera, camera_to_world
from activestereo.common.shown import did_you_mean, unknown
from activestereo.sensor.cuda_memory import MAPS, PICTURES, CudaArray
from activestereo.sensor.engine import SensorEngine

_Sensors = TypeVar("_Sensors", bound="SensorResults")
CAMERAS = ("rgb", *SIDES)


@dataclass(frozen=True)
class CameraInfo:
    """A camera's calibration. k: 3x3, pixel centres at integers; distortion: OpenCV's 5 coefficients, or 8 for a
    rational lens; camera_to_rgb: 4x4 from its axes (x right, y down, z forward) to the RGB camera's, metres."""

    width: int
    height: int
    k: NDArray[np.float64]
    distortion: tuple[float, ...]
    camera_to_rgb: NDArray[np.float64]


def camera_info(config: StereoDepthSensorConfig, camera: str) -> CameraInfo:
    """Returns the calibration of camera 'rgb', 'left' or 'right'; raises ValueError for another name."""
    if camera not in CAMERAS:
        raise ValueError(unknown("camera", camera, CAMERAS))
    if camera == "rgb":
        width, height = config.rgb_resolution
        return CameraInfo(width, height, config.rgb_intrinsic.copy(), config.rgb_distortion, np.eye(4))
    k, distortion = ir_intrinsics(config, camera == "right")
    width, height = config.ir_resolution
    pose = config.trans_pose_r if camera == "right" else config.trans_pose_l
    return CameraInfo(width, height, k.copy(), tuple(distortion), camera_to_camera(pose, Pose()))


_LENSES = {4: "kannala_brandt", 5: "brown_conrady", 8: "rational"}


def cameras_json(config: StereoDepthSensorConfig, rgb_to_world: NDArray[np.float64]) -> dict[str, Any]:
    """Returns the contents of the file camera.json that `simulate` writes. rgb_to_world: 4x4, from the RGB camera's
    axes to the scene's, metres."""
    cameras = {}
    for name in CAMERAS:
        camera = camera_info(config, name)
        cameras["rgb" if name == "rgb" else f"ir_{name}"] = {
            "image": "rgb.png" if name == "rgb" else f"ir_{name}.png",
            "width": camera.width,
            "height": camera.height,
            "K": camera.k.tolist(),
            "distortion_model": _LENSES[len(camera.distortion)],
            "distortion": list(camera.distortion),
            "camera_to_rgb": camera.camera_to_rgb.tolist(),
            "camera_to_world": (rgb_to_world @ camera.camera_to_rgb).tolist(),
        }
    depth = {"image": "depth.png", "frame": "rgb", "metres_per_unit": 0.001, "no_measurement": 0}
    return {
        "sensor": config.model,
        "units": "metres; K and distortion for pixels whose centres are whole numbers",
        "frame_axes": "x right, y down, z forward; world: the scene file's",
        "baseline_m": config.baseline_m,
        "cameras": cameras,
        "depth": depth,
        "depth_engine": depth_engine(config),
    }


def depth_engine(config: StereoDepthSensorConfig) -> dict[str, Any]:
    """Returns the matcher's parameters as a capture's depth_engine states them."""
    matcher = matcher_parameters(config)
    return {name: matcher.get(name, getattr(config, name)) for name in DEPTH_ENGINE}


class SensorResults(ABC):
    """Reads the results of one sensor or a batch. Arrays begin with the sensors' shape, (), [E] or [E, S], and continue
    with [height, width]; a method names further axes. Raises RuntimeError where there is no result: an infrared_only
    picture has no RGB image, true depth and ids. Unread results cost no copy. compute_depth() computes maps that were
    read before; others are computed when first read."""

    # The names that get_depth_map() takes.
    _depth_maps: tuple[str, ...] = DEPTH_MAPS
    _config: StereoDepthSensorConfig

    _engine: SensorEngine

    def close(self) -> None:
        """Removes the projectors and the model's additions from the scene. Results of the last picture stay readable;
        pictures, matching and changes raise RuntimeError from then on."""
        self._engine.rig.leave()

    def __enter__(self: _Sensors) -> _Sensors:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def frame_index(self) -> int:
        """Returns the number of the last picture, counted from 0; -1 before the first."""
        return self._engine.frame

    @property
    def stage_times(self) -> dict[str, float]:
        """Returns {stage: milliseconds} of the last take_picture() and compute_depth()."""
        return self._engine.stage_times

    @abstractmethod
    def _poses(self) -> NDArray[np.float64]:
        """Returns the RGB cameras' poses [..., 4, 4], body axes."""

    def get_config(self) -> StereoDepthSensorConfig:
        """Returns a copy of the configuration, with the present exposure and gain."""
        return deepcopy(self._config)

    def camera_info(self, camera: str = "rgb") -> CameraInfo:
        """Returns the calibrated image size, intrinsics, distortion and pose of camera 'rgb', 'left' or 'right'."""
        return camera_info(self._config, camera)

    def get_intrinsics(self, camera: str = "rgb") -> NDArray[np.float64]:
        """Returns the calibrated matrix K of this camera, [..., 3, 3]; pixel centres are at integers."""
        k, leading = self.camera_info(camera).k, self._poses().shape[:-2]
        return np.broadcast_to(k, (*leading, 3, 3)).copy()

    def get_extrinsics(self, camera: str = "rgb") -> NDArray[np.float64]:
        """Returns the camera's calibrated pose at the mount's present pose, [..., 4, 4] from its axes (x right, y down,
        z forward) to the scene's, metres."""
        return self._poses() @ camera_to_world(Pose()) @ self.camera_info(camera).camera_to_rgb

    @computed_once
    def rgb_rays(self) -> NDArray[np.float64]:
        """Returns [3, height, width]: ray directions through the RGB camera's pixel centres in its axes, with z = 1."""
        rgb = self.camera_info()
        v, u = np.indices((rgb.height, rgb.width))
        return np.stack([*to_tangents(u, v, rgb.k, rgb.distortion), np.ones(u.shape)])

    def get_depth(self) -> NDArray[np.float32]:
        """Returns float32 metres along the RGB camera's z axis, in its distorted image; 0 = no measurement."""
        return self._engine.maps.read("depth_rgb")

    def get_depth_mm(self) -> NDArray[np.int16]:
        """Returns int16 [..., height, width, 1] millimetres up to 32767 in the RGB camera; 0 = no measurement."""
        return np.rint(np.minimum(self.get_depth() * np.float32(1000.0), 32767.0)).astype(np.int16)[..., None]

    def get_disparity(self) -> NDArray[np.float32]:
        """Returns float32 pixels in the (rectified) left infrared camera; -1 = no measurement."""
        return self._engine.maps.read("disparity")

    def get_ir_measured(self) -> list[NDArray[Any]]:
        """Returns [left, right], the sensor's noisy images, uint8 (uint16 if ir_signal has more bits)."""
        return [self._engine.maps.read(f"ir_{side}") for side in SIDES]

    def get_depth_map(self, name: str) -> NDArray[Any]:
        """Returns 'points' float32 [..., height, width, 3] metres, in the RGB camera's axes and at its pixels, or a map
        of the (rectified) left infrared camera: 'confidence' float32 0..1, 'reason' uint8 an index into
        simsense.REASONS, or the images 'rectified_left' and 'rectified_right'."""
        self._check_depth_map(name)
        return self._engine.maps.read(name)

    def get_rgba8(self) -> NDArray[np.uint8]:
        """Returns uint8 [..., height, width, 4]: red, green, blue, 255, sRGB-encoded on the rendering device. Unless
        the configuration fixes an exposure, one is chosen for all sensors."""
        return self._engine.rgb_output("srgb")

    def get_rgb(self) -> NDArray[np.float32]:
        """Returns float32 [..., height, width, 3] in 0..1, as get_rgba8() without rounding. The host computes it, from
        a copy three times as large."""
        radiance = self._engine.rgb_output("radiance")
        return srgb(radiance, self._engine.plan.config.rgb_exposure or rgb_exposure(radiance))

    def get_true_depth(self) -> NDArray[np.float32]:
        """Returns float32 metres in the RGB camera to the first surface at each pixel's centre; 0 = none."""
        return self._engine.rgb_output("depth")[..., 0]

    def get_material_ids(self) -> NDArray[np.uint32]:
        """Returns uint32 material ids in the RGB camera; scene.material_name() names them, 0xffffffff = nothing
        there."""
        return self._engine.rgb_output("material_id")[..., 0]

    def get_instance_ids(self) -> NDArray[np.uint32]:
        """Returns uint32 instance ids in the RGB camera; scene.instance_name() names them, 0xffffffff = nothing
        there."""
        return self._engine.rgb_output("instance_id")[..., 0]

    def _check_depth_map(self, name: str) -> None:
        if name not in self._depth_maps:
            hint = ": name it there" if name in DEPTH_MAPS else did_you_mean(name, DEPTH_MAPS)
            raise ValueError(f"'{name}' is none of the config's depth_maps {self._depth_maps}{hint}")

    def get_cuda(self, name: str) -> CudaArray:
        """Returns the array of get_<name>() in CUDA memory without a copy, as float32, uint8, uint16 or uint32. Names
        are 'depth', 'disparity', 'ir_left', 'ir_right' (of ir_measured), a map of get_depth_map(), 'rgba8',
        'true_depth', 'instance_ids' or 'material_ids'; or 'radiance', the linear RGB image, W/(sr m^2), that get_rgb()
        encodes. torch.as_tensor(array, device="cuda") takes it. The next take_picture() or compute_depth() writes into
        the same memory. Raises RuntimeError without on_cuda, ValueError for another name."""
        engine = self._engine
        if not engine.maps.on_cuda:
            raise RuntimeError("these results are the host's: make the sensor with on_cuda=True")
        if name not in MAPS and name not in PICTURES:
            known = (*MAPS, *PICTURES)
            hint = did_you_mean(name, known)
            raise ValueError(f"a sensor has no '{name}' for CUDA (known: {', '.join(known)}){hint}")
        if name in DEPTH_MAPS:
            self._check_depth_map(name)
        if name in MAPS:
            return engine.maps.cuda(MAPS[name])
        rgb = engine.rgb_picture()
        shape = rgb.targets[PICTURES[name]].shape
        return rgb.cuda(PICTURES[name], (*engine.shape, *(shape[1:] if shape[-1] > 1 else shape[1:-1])))
