# SPDX-License-Identifier: Apache-2.0
"""GBufferStereo: active stereo depth on the images of any renderer, many environments at once.

    sensor = GBufferStereo("D435", environments=4096, materials={7: kuafu.Material(ir_albedo=0.4, roughness=0.3)})
    out = sensor(depth=depth, normal=normal, albedo=albedo, material=material)  # [E, height, width]
    out["depth"], out["ir_left"], out["valid"], out["cause"]
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
import simsense
from activestereo.camera.auto_exposure import AutoExposure
from activestereo.camera.config_limits import FRAME
from activestereo.camera.matching import make_engine, signal_parameters
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.limits import POWER, Limits
from activestereo.sensor.gbuffer.buffers import Floats, GBuffer, SurfaceTable, host_image, read_gbuffer
from activestereo.sensor.gbuffer.cause import causes, hidden_from_right
from activestereo.sensor.gbuffer.light import ProjectedLight, eye_of, lit_by_projector
from activestereo.sensor.gbuffer.rig import beside_m, inverse_depth
from activestereo.sensor.gbuffer.warp import warped
from activestereo.sensor.radiance import checked_radiance

_ENVIRONMENTS = Limits(1, 1_000_000, whole=True)
_SEED = Limits(0, 2**64 - 1, whole=True)
# What is rendered at a time, pixels: its arrays fit a processor's cache.
_CHUNK_PX = 1 << 16


class _Chunk(NamedTuple):
    """Some environments: radiance of both eyes, all and the projector's, and what causes() takes."""

    light: list[NDArray[np.float32]]
    laser: list[NDArray[np.float32]]
    seen: GBuffer
    is_lit: NDArray[np.bool_]
    is_hidden: NDArray[np.bool_]


class GBufferStereo:
    """An active stereo sensor on depth, normals and albedo of its left infrared camera in E environments.

    config: a StereoDepthSensorConfig, which is copied, or a camera's name; 'converging' exposure is 'settled'. device:
    where pairs are matched, as kuafu.Device has it; light is computed on the host. materials: kuafu.Materials by
    number, whose infrared albedo, roughness, specular, metallic and transmission hold. Light that is reflected more
    than once is not there: metal that mirrors and glass are named in 'cause'. ValueError for a configuration that has
    lenses that distort, rows that are not aligned, or optics without a law here.
    """

    def __init__(
        self, config: StereoDepthSensorConfig | str = "D435", environments: int = 1,
        device: str | int | kuafu.Device = "auto", materials: Any = None,
    ) -> None:  # fmt: skip
        self._config = StereoDepthSensorConfig(config) if isinstance(config, str) else deepcopy(config)
        if self._config.ir_exposure_mode == "converging":
            self._config.ir_exposure_mode = "settled"
        self._config.check()
        self._count = int(_ENVIRONMENTS.check("environments", environments))
        c = self._config
        for name in ("ir_distortion", "ir_distortion_right"):
            if np.any(getattr(c, name) or 0.0):
                raise ValueError(f"{name} is {getattr(c, name)}: G-buffers are of pinhole cameras: set it to zeros")
        self._table = SurfaceTable(materials)
        self._eyes = [eye_of(c, is_right) for is_right in (False, True)]
        self._baseline_m = beside_m(c.trans_pose_l, c.trans_pose_r, "the right infrared camera")
        self._shift_px = float(self._eyes[1].k[0, 2] - self._eyes[0].k[0, 2])
        self._projector_m = beside_m(c.trans_pose_l, c.pose_rgb_irproj, "the projector")
        self._light = ProjectedLight(c)
        device = device if isinstance(device, kuafu.Device) else kuafu.Device(device)
        self._engine = make_engine(c, simsense.Device(device.info.device_uuid), self._count)
        self._signal = signal_parameters(c)
        self._engine.set_signal(self._signal, self._signal)
        self._exposure, self._frame = AutoExposure(c), -1
        self._max_dn = float(2 ** int(self._signal["bit_depth"]) - 1)

    @property
    def shape(self) -> tuple[int, int, int]:
        """(environments, height, width) of all images."""
        width, height = self._config.ir_resolution
        return self._count, height, width

    @property
    def k(self) -> NDArray[np.float64]:
        """The 3x3 matrix of the left infrared camera, which depth, normals and albedo have to be of."""
        return self._eyes[0].k.copy()

    def get_config(self) -> StereoDepthSensorConfig:
        """A copy."""
        return deepcopy(self._config)

    def restart(self, seed: int) -> None:
        """The next call is frame 0 under this seed: from here on all noise is as it was after the same restart."""
        self._engine.set_parameters(noise_seed=int(_SEED.check("the seed", seed)))
        self._frame = -1

    def __call__(
        self, *, depth: Any, normal: Any = None, albedo: Any = None, material: Any = None, depth_kind: str = "planar",
        right: Mapping[str, Any] | None = None, projector: Any = None, ambient: ArrayLike | None = None,
        laser_power: ArrayLike = 1.0, exposure: ArrayLike = 1.0,
    ) -> dict[str, NDArray[Any]]:  # fmt: skip
        """One frame of all environments, from arrays of NumPy, torch, or what speaks DLPack.

        depth [E, height, width] metres along the axis ('planar') or the ray ('ray'), 0 or inf = nothing there; normal
        [..., 3] unit, in the camera's axes (x right, y down, z forward), None = of the depth; albedo 0..1 or uint8, of
        RGB the red channel is taken as the infrared's; material: numbers of `materials`. right: the same four of the
        right infrared camera, else its view is warped from the left one, and what that does not see is the background
        continued. projector: planar depth [E, height, width] of a camera like the left one in the
        projector's place, for exact shadows. ambient: radiance from all sides, a number, [E] or [E, height, width]
        W/(sr m^2), None = ir_ambient_radiance. laser_power, exposure: over the configuration's, a number or [E].

        Returns depth float32 metres in the left infrared camera, 0 = no measurement; disparity float32 pixels, -1;
        ir_left, ir_right as the imager counts; valid bool; cause uint8, an index into cause.CAUSES. ValueError names
        the environment and the value that cannot be; then no frame was taken.
        """
        own = {"depth": depth, "normal": normal, "albedo": albedo, "material": material}
        seen = read_gbuffer(own, self.shape, self._eyes[0].rays, depth_kind, self._table)
        other = None
        if right is not None:
            if "depth" not in right:
                raise ValueError("right has no 'depth'")
            other = read_gbuffer(right, self.shape, self._eyes[1].rays, depth_kind, self._table)
        hiding = None if projector is None else inverse_depth(host_image("projector", projector, self.shape))
        power, share = self._per_environment("laser_power", laser_power), self._per_environment("exposure", exposure)
        room = self._ambient(ambient)
        frame = int(FRAME.check("the frame", self._frame + 1))
        c = self._config
        intensity = power * c.projector_intensity * c.emitter_power(frame)
        step = max(1, _CHUNK_PX // int(np.prod(self.shape[1:])))

        def chunk_from(first: int) -> _Chunk:
            part = slice(first, first + step)
            views = [None if view is None else _part(view, part) for view in (seen, other)]
            return self._chunk(views, None if hiding is None else hiding[part], intensity[part], room[part])

        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as threads:  # NumPy works outside of Python's lock
            chunks = list(threads.map(chunk_from, range(0, self._count, step)))
        eyes = [np.concatenate([chunk.light[eye] for chunk in chunks]) for eye in (0, 1)]
        lasers = [np.concatenate([chunk.laser[eye] for chunk in chunks]) for eye in (0, 1)]
        light = np.array([np.float32(own) * self._light_of(left) for own, left in zip(share, eyes[0], strict=True)])
        for images in (*eyes, *lasers):
            images *= light[:, None, None]
        apart = (lasers[0], lasers[1]) if c.ir_speckle_of_laser else (None, None)
        self._frame = frame
        out = self._matched(eyes[0], eyes[1], *apart)
        found = [
            causes(c, chunk.seen, chunk.is_lit, chunk.is_hidden, counts, reason, self._black_dn, self._max_dn)
            for chunk, counts, reason in zip(
                chunks, _cut(out["ir_left"], step), _cut(out.pop("reason"), step), strict=True
            )
        ]
        return out | {"valid": out["depth"] > 0.0, "cause": np.concatenate(found)}

    def compute_depth_from(
        self, left: ArrayLike, right: ArrayLike, left_laser: ArrayLike | None = None,
        right_laser: ArrayLike | None = None,
    ) -> dict[str, NDArray[Any]]:  # fmt: skip
        """depth, disparity, ir_left, ir_right and the matcher's reason of radiance of one's own, [E, height, width]
        W/(sr m^2), as the next frame. *_laser: the projector's part, which alone has speckle; without, all has."""
        pair, lasers = checked_radiance(left, right, left_laser, right_laser, self.shape)
        self._frame += 1
        return self._matched(*pair, lasers.get("left_laser"), lasers.get("right_laser"))

    # ---- inside ----

    @property
    def _black_dn(self) -> float:
        return float(self._signal["black_level_dn"])

    def _chunk(
        self, views: list[GBuffer | None], hiding: Floats | None, intensity: Floats, ambient: Floats
    ) -> _Chunk:
        left, right = views
        assert left is not None
        focal, (own, other) = float(self._eyes[0].k[0, 0]), self._eyes
        beside = warped(left.inverse_depth, focal, self._baseline_m, self._shift_px)
        if right is None:
            right = left.taken(beside.inverse_depth, beside.pixel)
        if hiding is None:
            place = warped(left.inverse_depth, focal, self._projector_m)
            hiding = np.where(place.seen, place.inverse_depth, 0.0)
        lit = [
            lit_by_projector(left, own, self._projector_m, 0.0, hiding),
            lit_by_projector(right, other, self._projector_m - self._baseline_m, self._shift_px, hiding),
        ]
        found = [
            self._light.seen(eye, view, is_lit, intensity, ambient)
            for eye, view, is_lit in zip(self._eyes, (left, right), lit, strict=True)
        ]
        hidden = hidden_from_right(self._config, left, beside.inverse_depth)
        return _Chunk([f[0] for f in found], [f[1] for f in found], left, lit[0], hidden)

    def _matched(self, left: Any, right: Any, left_laser: Any, right_laser: Any) -> dict[str, NDArray[Any]]:
        self._engine.set_parameters(frame_index=self._frame, scene_index=0)
        lasers = {} if left_laser is None else {"left_laser": left_laser, "right_laser": right_laser}
        wanted = ("depth", "disparity", "ir_left", "ir_right", "reason")
        if self._count == 1:  # an engine of one pair has no axis of pairs
            left, right = left[0], right[0]
            lasers = {name: image[0] for name, image in lasers.items()}
        found = self._engine.compute(left, right, wanted, **lasers)
        return {name: image.reshape(self.shape) for name, image in found.items()}

    def _light_of(self, left: NDArray[np.float32]) -> np.float32:
        if self._exposure.mode == "fixed":
            return np.float32(1.0)
        setting = self._exposure.after(self._config, self._signal, left, self._max_dn)
        return np.float32(setting.light_s / self._exposure.start.light_s)

    def _per_environment(self, name: str, values: ArrayLike) -> Floats:
        numbers = np.asarray(values, np.float64)
        if numbers.shape not in ((), (self._count,)):
            raise ValueError(f"{name} is {list(numbers.shape)}, expected a number or [{self._count}]")
        for n, value in enumerate(np.atleast_1d(numbers).tolist()):
            POWER.check(f"{name} of environment {n}" if numbers.shape else name, value)
        return np.broadcast_to(numbers, (self._count,))

    def _ambient(self, values: ArrayLike | None) -> Floats:
        room = np.asarray(self._config.ir_ambient_radiance if values is None else values, np.float64)
        if room.shape == (self._count,):
            room = room[:, None, None]
        if room.shape not in ((), (self._count, 1, 1), self.shape):
            raise ValueError(f"ambient is {list(room.shape)}, expected a number, [{self._count}] or {list(self.shape)}")
        if not (np.isfinite(room) & (room >= 0.0)).all():
            raise ValueError(f"ambient is {float(room.min()):g} at least, expected finite radiances of 0 or more")
        return np.broadcast_to(room, (self._count, *room.shape[1:]) if room.ndim else (self._count, 1, 1))


def _part(view: GBuffer, part: slice) -> GBuffer:
    return GBuffer(*(getattr(view, name)[part] for name in GBuffer.__dataclass_fields__))


def _cut(image: NDArray[Any], step: int) -> list[NDArray[Any]]:
    return [image[first : first + step] for first in range(0, len(image), step)]

