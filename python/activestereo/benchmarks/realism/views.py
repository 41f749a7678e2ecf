# SPDX-License-Identifier: Apache-2.0
"""Real views: a pair, the device's depth, and the surfaces in view."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.capture.capture import Capture, Frame
from activestereo.capture.images import read_gray
from activestereo.common.pose import body_pose
from activestereo.effects.core.room_light import RoomLight, has_room_light, light_by_room
from activestereo.scene_io.scene_files import load_scene_file

Map = NDArray[np.float32]


@dataclass(frozen=True)
class RealView:
    """left, right: DN. device_m: the device's depth in the left camera, truth_m the scene model's; 0 = none. room: the
    room's light as measured on the surfaces, None if the scene has lights of its own."""

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

    def pose(self) -> NDArray[np.float64]:
        return body_pose(self.frame.camera_to_world).to_transformation_matrix()

    def disparity(self, depth_m: Map) -> Map:
        """Disparity in pixels, NaN without depth."""
        with np.errstate(divide="ignore"):
            return np.where(depth_m > 0, self.focal_baseline_px_m / depth_m, np.float32(np.nan)).astype(np.float32)


def real_views(capture: Capture, device_depth: Path | None, device: str | int) -> list[RealView]:
    """The views of a capture with a pair and the device's depth. device_depth: a folder of the device's 16-bit PNG
    files in millimetres, in order of the frames, if the capture's own depth is a better instrument's. Raises ValueError
    if the counts differ."""
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
