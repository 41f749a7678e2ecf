# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's context, devices and sensors, of one simulated camera."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

from activestereo.camera.advanced_mode import AdvancedSettings
from activestereo.camera.advanced_mode.settings import parse_settings
from activestereo.integrations.realsense.camera import SimulatedCamera, World, sensor_ranges
from activestereo.integrations.realsense.enums import camera_info, format, option, stream
from activestereo.integrations.realsense.frames import StreamRequest, video_stream_profile
from activestereo.integrations.realsense.options import GROUPS, Options, group_of, with_group

_PRODUCT_IDS = {"D405": "0B5B", "D415": "0AD3", "D435": "0B07", "D435I": "0B3A", "D455": "0B5C"}
_SIZES, _FPS = ((640, 480), (848, 480), (1280, 720)), 30
_worlds: list[World] = []


def simulate(world: World) -> None:
    """Sets the world for cameras of this module; running pipelines keep theirs."""
    _worlds[:] = [world]


class sensor(Options):
    """One of a device's sensors. modes: of each stream and index, its formats."""

    modes: dict[tuple[stream, int], tuple[format, ...]] = {(stream.color, 0): (format.rgb8, format.bgr8)}

    def __init__(self, name: str, camera: SimulatedCamera, *args: Any) -> None:
        super().__init__(*args)
        self.name, self._camera = name, camera

    def get_stream_profiles(self) -> list[video_stream_profile]:
        """The usual modes; a pipeline takes any size."""
        return [
            video_stream_profile(
                StreamRequest(kind, index, *size, form, _FPS),
                self._camera.lens(kind, size),
                self._camera.left_to(kind, index),
                self._camera.baseline_m,
            )
            for (kind, index), forms in self.modes.items()
            for size in _SIZES
            for form in forms
        ]

    def get_info(self, which: int) -> str:
        if which != camera_info.name:
            raise RuntimeError(f"info {which} not supported by the device")
        return self.name


class depth_sensor(sensor):
    modes = {
        (stream.depth, 0): (format.z16,),
        (stream.infrared, 1): (format.y8,),
        (stream.infrared, 2): (format.y8,),
    }

    def __init__(self, camera: SimulatedCamera) -> None:
        ranges = sensor_ranges(camera.base)
        baseline_mm = 1e3 * camera.baseline_m
        super().__init__("Stereo Module", camera, ranges, {option.stereo_baseline: baseline_mm}, camera.set_option)

    def set_option(self, which: option, value: float) -> None:
        """As in librealsense, setting an exposure or gain ends automatic exposure."""
        super().set_option(which, value)
        if which in (option.exposure, option.gain):
            self._values[option.enable_auto_exposure] = 0.0

    def get_depth_scale(self) -> float:
        """Metres per count."""
        return self._camera.unit_m


class device:
    def __init__(self, camera: SimulatedCamera | None = None) -> None:
        self.camera = camera or SimulatedCamera(_worlds[0] if _worlds else World.of_environment())
        self._depth, self._color = depth_sensor(self.camera), sensor("RGB Camera", self.camera, {})
        model = self.camera.base.model.upper().removeprefix("SAPIEN-")
        self._info = {
            camera_info.name: f"Intel RealSense {model} (simulated)",
            camera_info.serial_number: "000000000000",
            camera_info.firmware_version: "5.16.0.1",
            camera_info.physical_port: "simulated",
            camera_info.advanced_mode: "YES",
            camera_info.product_id: _PRODUCT_IDS.get(model, "0B07"),
            camera_info.usb_type_descriptor: "3.2",
            camera_info.product_line: "D400",
        }

    def supports(self, which: int) -> bool:
        return which in self._info

    def get_info(self, which: int) -> str:
        if which not in self._info:
            raise RuntimeError(f"info {which} not supported by the device")
        return self._info[which]

    def query_sensors(self) -> list[sensor]:
        return [self._depth, self._color]

    sensors = property(query_sensors)

    def first_depth_sensor(self) -> depth_sensor:
        return self._depth

    def first_color_sensor(self) -> sensor:
        return self._color

    def hardware_reset(self) -> None:
        """Resets all options to their defaults."""
        self.camera.close()
        self.__init__(SimulatedCamera(self.camera.world))  # type: ignore[misc]  # the object stays the script's


class device_list(list[device]):
    def size(self) -> int:
        return len(self)


class context:
    """A host with one simulated camera."""

    def __init__(self) -> None:
        self.devices = device_list([device()])

    def query_devices(self) -> device_list:
        return self.devices

    def __iter__(self) -> Iterator[device]:
        return iter(self.query_devices())


class rs400_advanced_mode:
    """A device's settings as JSON, and as groups of controls: get_depth_table(mode) and set_depth_table(group), and so
    on for each of GROUPS."""

    def __init__(self, of: device) -> None:
        self._device = of

    def is_enabled(self) -> bool:
        return True

    def toggle_advanced_mode(self, enable: bool) -> None:
        """Ignored: advanced mode is always on."""

    def load_json(self, text: str) -> None:
        """Raises RuntimeError, as librealsense does, if a key is unknown or out of range."""
        self._set(lambda: parse_settings(json.loads(text), "the settings"))

    def __getattr__(self, name: str) -> Any:
        what, _, group = name.partition("_")
        if what not in ("get", "set") or group not in GROUPS:
            raise AttributeError(f"'rs400_advanced_mode' object has no attribute '{name}'")
        if what == "get":
            return lambda mode=0: group_of(self._device.camera.settings, group, mode)
        return lambda numbers: self._set(lambda: with_group(self._device.camera.settings, group, numbers))

    def _set(self, make: Callable[[], AdvancedSettings]) -> None:
        try:
            self._device.camera.set_settings(make())
        except ValueError as error:
            raise RuntimeError(str(error)) from error

    def serialize_json(self) -> str:
        """Every key of the matcher and the depth table, as librealsense writes them, and the others that were given."""
        return json.dumps(self._device.camera.settings.as_text(), indent=4)
