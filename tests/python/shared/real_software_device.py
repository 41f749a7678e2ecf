# SPDX-License-Identifier: Apache-2.0
"""Simulated frames in the real pyrealsense2's software device, with its own align, filters and recorder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from activestereo.integrations.realsense.options import format, stream
from activestereo.integrations.realsense.frames import composite_frame, frame, video_stream_profile


class SoftwareDevice:
    """An open, started software_device of pyrealsense2. device: the real one, for a recorder; syncer: gives frames."""

    def __init__(self, profiles: Sequence[video_stream_profile], unit_m: float = 0.001) -> None:
        import pyrealsense2 as rs

        self._rs, self._unit_m = rs, unit_m
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.name, "Intel RealSense (simulated)")
        self.device.register_info(rs.camera_info.serial_number, "000000000000")
        self.syncer: Any = rs.syncer()
        self._sensors: dict[str, Any] = {}
        self._profiles: dict[tuple[stream, int], Any] = {}
        right = [p.left_to_stream for p in profiles if (p.stream_type(), p.stream_index()) == (stream.infrared, 2)]
        told_m = [p.baseline_m for p in profiles if p.baseline_m is not None] + [
            -float(motion[0, 3]) for motion in right
        ]
        self._baseline_mm = 1e3 * told_m[0] if told_m else None
        for profile in profiles:
            self._add(profile)
        self._relate(profiles)
        self.device.create_matcher(rs.matchers.default)
        self._is_started = False

    def _add(self, profile: video_stream_profile) -> None:
        rs, kind = self._rs, profile.stream_type()
        name = "RGB Camera" if kind == stream.color else "Stereo Module"
        if name not in self._sensors:
            self._sensors[name] = self.device.add_sensor(name)
            if name == "Stereo Module":
                self._sensors[name].add_read_only_option(rs.option.depth_units, self._unit_m)
                if self._baseline_mm is not None:
                    self._sensors[name].add_read_only_option(rs.option.stereo_baseline, self._baseline_mm)
        made = rs.video_stream()
        made.type, made.index, made.uid = rs.stream(int(kind)), profile.stream_index(), profile.unique_id()
        made.width, made.height, made.fps = profile.width(), profile.height(), profile.fps()
        made.fmt, made.bpp = rs.format(int(profile.format())), _bytes(profile.format())
        lens = rs.intrinsics()
        own = profile.get_intrinsics()
        for field in ("width", "height", "ppx", "ppy", "fx", "fy", "coeffs"):
            setattr(lens, field, getattr(own, field))
        lens.model = rs.distortion(int(own.model))
        made.intrinsics = lens
        self._profiles[kind, profile.stream_index()] = self._sensors[name].add_video_stream(made)

    def _relate(self, profiles: Sequence[video_stream_profile]) -> None:
        for a in profiles:
            for b in profiles:
                if a is not b:
                    motion = self._rs.extrinsics()
                    own = a.get_extrinsics_to(b)
                    motion.rotation, motion.translation = own.rotation, own.translation
                    key = (a.stream_type(), a.stream_index()), (b.stream_type(), b.stream_index())
                    self._profiles[key[0]].register_extrinsics_to(self._profiles[key[1]], motion)

    def start(self, queue: Any = None) -> None:
        """Opens all streams; their frames go to the syncer, or to a queue of one's own."""
        for name, sensor in self._sensors.items():
            is_color = name == "RGB Camera"
            wanted = [p for (kind, _), p in self._profiles.items() if (kind == stream.color) == is_color]
            sensor.open(wanted)
            sensor.start(self.syncer if queue is None else queue)
        self._is_started = True

    def send(self, frames: composite_frame) -> None:
        """Puts a frameset's frames into the real device."""
        if not self._is_started:
            self.start()
        for one in frames:
            self._send(one)

    def _send(self, one: frame) -> None:
        rs, kind = self._rs, one.profile.stream_type()
        made = rs.software_video_frame()
        made.pixels = np.ascontiguousarray(one.get_data()).reshape(-1).view(np.uint8)
        made.bpp = _bytes(one.profile.format())
        made.stride = one.profile.width() * made.bpp
        made.timestamp, made.domain = one.timestamp, rs.timestamp_domain.hardware_clock
        made.frame_number = one.frame_number
        made.profile = self._profiles[kind, one.profile.stream_index()].as_video_stream_profile()
        if kind == stream.depth:
            made.depth_units = self._unit_m
        self._sensors["RGB Camera" if kind == stream.color else "Stereo Module"].on_video_frame(made)

    def stop(self) -> None:
        for sensor in self._sensors.values():
            sensor.stop()
            sensor.close()


def _bytes(form: format) -> int:
    return {format.z16: 2, format.y8: 1, format.rgb8: 3, format.bgr8: 3, format.rgba8: 4, format.bgra8: 4}[form]
