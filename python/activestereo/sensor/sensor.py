# SPDX-License-Identifier: Apache-2.0
"""StereoDepthSensor: RGB camera, infrared pair and pattern projector in a kuafu scene, with simsense behind them. Names
are SAPIEN's."""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
import simsense
from activestereo.camera.auto_exposure import AutoExposure, encoded_rgb
from activestereo.camera.config_limits import checked_twist
from activestereo.camera.matching import Taken, engine_parameters, linear_counts, make_engine, renderer_parameters
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import SIDES
from activestereo.common.computed_once import computed_once
from activestereo.common.lens import pixel_rays
from activestereo.common.limits import TEMPERATURE, TIME
from activestereo.common.nearest import unknown
from activestereo.common.pose import Pose, as_matrix, camera_to_world
from activestereo.common.progress_bar import Progress, part_of
from activestereo.effects.core.engine import EngineInputs, apply_engine, moved_pose
from activestereo.model import SensorModel
from activestereo.sensor.cuda_memory import CudaArray
from activestereo.sensor.gbuffer.traced import traced_causes
from activestereo.sensor.image_effects import ImageEffects, ModelCostWarning
from activestereo.sensor.inputs import exposed_anew, exposure, fitted_to, render_settings, sensor_inputs, shutter
from activestereo.sensor.ir_link import IrLink
from activestereo.sensor.mount import Mount as Mount
from activestereo.sensor.mount import RigPlace, as_mount
from activestereo.sensor.radiance import checked_radiance
from activestereo.sensor.results import SensorResults, require_picture
from activestereo.sensor.rig_motion import give_velocity, twist_of
from activestereo.sensor.world import LATER, SensorWorld

Band = Literal["visible", "infrared"]


class StereoDepthSensor:
    """An active stereo depth sensor.

    config: a StereoDepthSensorConfig; it is copied. scene_or_mount: a kuafu.Scene, a Mount, or the path of a scene
    file. pose: the RGB camera's pose, in the scene or relative to the mount; body axes (x forward, y left, z up) as in
    SAPIEN. device: 'auto', 'cpu', an index or a kuafu.Device, where the scene does not bring its own. copy_ir: copies
    the infrared pair between the libraries instead of sharing its memory. The projector becomes a light of the scene,
    seen in the infrared only, and shines while this sensor's pictures are taken (always, if the config's
    projector_always_on says so). It goes with the sensor: at close(), at the end of a `with` block, or when nothing
    refers to the sensor any more. One thread at a time.

    model: a model.SensorModel or the path of a model.json. Its effects act inside of the engines; those that no
    engine field expresses change the images, with a ModelCostWarning. Its rig, pattern and imager are the config's:
    StereoDepthSensorConfig.from_model(). ValueError says what in it does not fit this scene; then nothing has been
    changed.

    on_cuda: RGB pictures and maps lie where CUDA sees them, for get_cuda(). CudaError where there is no CUDA, or none
    on this GPU; ValueError for a model that changes the images.
    """

    def __init__(
        self, config: StereoDepthSensorConfig, scene_or_mount: kuafu.Scene | Mount | str | PathLike[str],
        pose: Pose | None = None, device: str | int | kuafu.Device = "auto", copy_ir: bool = False,
        model: SensorModel | str | PathLike[str] | None = None, on_cuda: bool = False,
    ) -> None:  # fmt: skip
        self._config = deepcopy(config)
        self._config.check()
        self._mount = as_mount(scene_or_mount, device)
        self._rig = RigPlace(self._mount, Pose() if pose is None else pose)
        self._twist = np.zeros(6)
        self._scene = self._mount.scene
        self._device = self._scene.device
        found = fitted_to(self._scene, scene_or_mount, model, self._config)
        self._effects, self._scene_measurement, self._ambient_radiance = found
        self._conditions: tuple[float | None, float] = (None, 0.0)
        self._place, self._speckle_draw = None, -1
        self._exposure, self._next_setting = AutoExposure(self._config), None
        self._renderer = kuafu.Renderer(self._device, **renderer_parameters(self._config))
        self._engine = self.make_engine()
        self._results = SensorResults(self._device, self._engine.device, self._config, on_cuda)
        width, height = self._config.ir_resolution
        self._link = IrLink(self._device, self._engine.device, width, height, copy=copy_ir)
        pattern = self._config.pattern() if self._config.light_dots is None else None
        self._world = SensorWorld(self._scene, None if pattern is None else pattern[0])
        weakref.finalize(self, self._world.leave).atexit = False
        self._inputs, self._frame, self._lit_frame, self._is_closed = None, -1, -1, False
        try:
            self._tell_engines()
        except BaseException:
            self.close()
            raise
        self._image_effects = ImageEffects(weakref.proxy(self), self._left_over)
        if self._image_effects:
            names = ", ".join(self._image_effects.names)
            if on_cuda:
                self.close()
                raise ValueError(f"no engine field expresses {names}: such a model needs a sensor without on_cuda")
            text = f"no engine field expresses {names}: every picture is copied to the host and back"
            warnings.warn(text, ModelCostWarning, stacklevel=2)
        self._taken = Taken()
        self._stage_times: dict[str, float] = {}

    # ---- taking pictures ----

    def take_picture(self, infrared_only: bool = False, progress: Progress | None = None) -> None:
        """Renders the infrared pair, and before it the RGB picture unless infrared_only. progress(fraction) may return
        True to cancel. A call that fails or is cancelled leaves no picture."""
        results = self._results
        results.has_picture = False
        results.maps.clear()
        frame = self._frame + 1
        taken = self._prepare(frame)
        share = 0.0 if infrared_only else 0.5
        with self._projector_on():
            if not infrared_only:
                results.has_rgb = False
                results.rgb.forget()
                self._render([self.rgb_camera()], results.rgb.targets, "visible", frame, part_of(progress, 0.0, share))
                results.has_rgb = True
                self._keep_times("rgb", self._renderer)
            self._render_infrared(taken, self._link, part_of(progress, share, 1.0))
            self._keep_times("ir", self._renderer)
        self._image_effects.on_light(self._link)
        self._link.deliver()
        self._expose(self._link)
        self._frame, results.has_picture, self._taken = frame, True, taken

    def compute_depth(self) -> None:
        """Noise, matching, registration of the last picture. The same picture gives the same depth. Maps that have been
        read of an earlier picture are computed with it; others when they are first read."""
        require_picture(self._results.has_picture)
        self._tell_engines()
        self._results.match(self._match)
        self._keep_times("depth", self._engine)

    def compute_depth_from(
        self, left: ArrayLike, right: ArrayLike, left_laser: ArrayLike | None = None,
        right_laser: ArrayLike | None = None, outputs: tuple[str, ...] = ("disparity",), frame_index: int = 0,
    ) -> dict[str, np.ndarray]:  # fmt: skip
        """{output of simsense.Engine.compute: array} of radiance of one's own, [height, width] W/(sr m^2), with picture
        frame_index's noise. *_laser: the projector's part, which alone has speckle; without, all has."""
        pair, lasers = checked_radiance(left, right, left_laser, right_laser, self._config.ir_resolution[::-1])
        self._match_rest()
        self._engine.set_signal(*self._signals())
        self._engine.set_parameters(frame_index=frame_index, scene_index=0)
        return self._image_effects.depth(self._engine, pair, outputs, **lasers)

    # ---- results ----

    def get_rgba8(self) -> NDArray[np.uint8]:
        """uint8 [height, width, 4]: red, green, blue, 255, sRGB-encoded where the picture was rendered."""
        return self._results.picture("srgb")

    def get_rgb(self) -> NDArray[np.float32]:
        """float32 [height, width, 3] in 0..1, sRGB-encoded here; get_rgba8() is a third of the copy and no work."""
        return encoded_rgb(self._results.picture("radiance"), self._config.rgb_exposure)

    def get_ir(self) -> list[NDArray[np.float32]]:
        """[left, right] float32 [height, width] in 0..1: what linear imagers would count without noise and dark
        current, over full scale."""
        require_picture(self._results.has_picture)
        return [linear_counts(*eye) for eye in zip(self._link.images(), self._signals(), strict=True)]

    def get_ir_measured(self) -> list[np.ndarray]:
        """[left, right] uint8 (uint16 where ir_signal has more bits) [height, width]: what the sensor gives, noisy."""
        return [self._results.map("ir_left", self._match), self._results.map("ir_right", self._match)]

    def get_depth(self) -> NDArray[np.float32]:
        """float32 [height, width] metres in the RGB camera, through its lens; 0 = no measurement."""
        return self._results.map("depth_rgb", self._match)

    def get_disparity(self) -> NDArray[np.float32]:
        """float32 [height, width] pixels in the (rectified) left infrared camera; -1 = no measurement."""
        return self._results.map("disparity", self._match)

    def get_depth_map(self, name: str) -> np.ndarray:
        """One of the config's depth_maps, of the (rectified) left infrared camera: 'confidence' float32 [height, width]
        0..1, 'reason' uint8 [height, width] an index into simsense.REASONS, 'points' float32 [height, width, 3] metres,
        'rectified_left', 'rectified_right'; always 'cause', uint8 [height, width] an index into gbuffer.cause.CAUSES:
        what in the scene, as it is now, made the hole."""
        if name == "cause":
            return traced_causes(self, self._results.map("reason", self._match))
        return self._results.depth_map(name, self._match)

    def get_pointcloud(self, with_rgb: bool = False) -> NDArray[np.float32]:
        """float32 [n, 3], metres in the RGB camera's axes (x right, y down, z forward); with_rgb: and colours."""
        depth = self.get_depth()
        v, u = np.nonzero(depth)
        points = (self.rgb_rays()[:, v, u] * depth[v, u]).T.astype(np.float32)
        return np.hstack([points, self.get_rgb()[v, u]]) if with_rgb else points

    def get_true_depth(self) -> NDArray[np.float32]:
        """float32 [height, width] metres in the RGB camera of the first surface at each pixel's centre; 0 = none."""
        return self._results.picture("depth")[..., 0]

    def get_material_ids(self) -> NDArray[np.uint32]:
        """uint32 [height, width] in the RGB camera; scene.material_name() names them, 0xffffffff = nothing there."""
        return self._results.picture("material_id")[..., 0]

    def get_instance_ids(self) -> NDArray[np.uint32]:
        """uint32 [height, width] in the RGB camera; scene.instance_name() names them, 0xffffffff = nothing there."""
        return self._results.picture("instance_id")[..., 0]

    def get_cuda(self, name: str) -> CudaArray:
        """What get_<name>() has, in CUDA memory and without a copy, of a sensor made with on_cuda: the names and the
        rest are as StereoDepthSensorBatch.get_cuda() has them."""
        return self._results.cuda(name, self._match)

    def get_picture(self, name: str, camera: str = "rgb") -> np.ndarray:
        """[height, width, channels]: one of kuafu's outputs ('position', 'albedo', ...; see kuafu.Renderer) as camera
        'rgb', 'left' or 'right' sees it now; projector_* of this sensor's. Needs no take_picture()."""
        if camera not in ("rgb", *SIDES):
            raise ValueError(unknown("camera", camera, ("rgb", *SIDES)))
        frame, right = max(self._frame, 0), camera == "right"
        with self._projector_on():
            if camera == "rgb":
                return self._render([self.rgb_camera()], [name], "visible", frame, None)[name][0]
            return self._render([self.ir_cameras()[right]], [name], "infrared", frame, None, eyes=[right])[name][0]

    # ---- the sensor itself ----

    def get_config(self) -> StereoDepthSensorConfig:
        """A copy."""
        return deepcopy(self._config)

    def get_pose(self) -> Pose:
        """The RGB camera's pose in the scene (body axes)."""
        return self._rig.pose()

    def set_local_pose(self, pose: Pose | np.ndarray) -> None:
        """Pose relative to the mount, or in the scene where there is none."""
        self._rig.local = Pose(as_matrix(pose))

    def set_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """What the whole sensor, projector included, does while its shutters are open, m/s and rad/s in the left
        infrared camera's own frame (x right, y down, z forward): pose(t) = pose exp(t [linear, angular]), as
        camera_velocity of captures; zeros = it stands still. It moves nothing from one picture to the next:
        set_local_pose() does, and is the pose in the middle of the exposure."""
        self._twist = checked_twist(linear, angular)
        self._move()

    def get_velocity(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(linear, angular) as set_velocity() has them."""
        return self._twist[:3].copy(), self._twist[3:].copy()

    def set_conditions(self, temperature_c: float | None = None, time_s: float = 0.0) -> None:
        """What a model's effects may depend on: the sensor's temperature (None: that of its signal) and the seconds
        since it was switched on."""
        if temperature_c is not None:
            TEMPERATURE.check("temperature_c", temperature_c)
        TIME.check("time_s", time_s)
        self._match_rest()
        self._conditions = (None if temperature_c is None else float(temperature_c), float(time_s))
        self._inputs = None

    @property
    def scene(self) -> kuafu.Scene:
        return self._scene

    @property
    def device(self) -> kuafu.Device:
        return self._device

    @property
    def engine(self) -> simsense.Engine:
        """The depth engine, a simsense.Engine."""
        return self._engine

    def engine_inputs(self) -> EngineInputs:
        """The engines' inputs for this sensor under its model, with the infrared cameras at their present poses."""
        self.ir_cameras()
        return self._tell_engines()

    @property
    def projector_to_world(self) -> NDArray[np.float64]:
        """4x4, the projector's own axes to the scene's."""
        return self._rig.matrix() @ camera_to_world(self._config.pose_rgb_irproj)

    @property
    def frame_index(self) -> int:
        """Counts the pictures, from 0; -1 before the first."""
        return self._frame

    @property
    def ir_memory(self) -> str:
        """How the infrared pair reaches the engine: 'opaque_fd', 'host' or 'copy'."""
        return self._link.memory

    @property
    def ir_gain(self) -> float:
        """Counts per W/(sr m^2)."""
        return self._config.ir_camera_exposure * self._config.ir_camera_gain * self._config.ir_responsivity_dn

    @property
    def stage_times(self) -> dict[str, float]:
        """{stage: milliseconds} of the last take_picture and compute_depth."""
        return dict(self._stage_times)

    @computed_once
    def rgb_rays(self) -> NDArray[np.float64]:
        """[3, height, width]: where the middles of the RGB camera's pixels look in its axes, with z = 1."""
        c, (v, u) = self._config, np.indices(self._config.rgb_resolution[::-1])
        return pixel_rays(u.ravel(), v.ravel(), c.rgb_intrinsic, c.rgb_distortion).reshape(3, *u.shape)

    def rgb_camera(self) -> kuafu.Camera:
        c = self._config
        more = shutter(c.rgb_line_time_s, c.rgb_readout) | {"exposure_s": c.rgb_exposure_s}
        return self._camera(c.rgb_resolution, c.rgb_intrinsic, Pose(), more | {"distortion": c.rgb_distortion})

    def ir_cameras(self) -> list[kuafu.Camera]:
        """The left and the right one, as they are: under a model not what the calibration says."""
        to_world = self._rig.matrix()
        cameras = [eye.camera for eye in self._tell_engines().sides]
        for camera, pose in zip(cameras, self._eye_poses, strict=True):
            camera.camera_to_world = to_world @ pose
        return cameras

    def __enter__(self) -> StereoDepthSensor:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Takes the projector, its pattern, and what else a model brought, out of the scene."""
        self._world.leave()
        self._is_closed = True

    # ---- parameters ----

    def set_ir_noise(self, ir_speckle_noise: float, ir_thermal_noise: float) -> None:
        """Scales of the default noise; ir_speckle_noise 0 switches both off. It takes the place of ir_signal."""
        self._set(ir_speckle_noise=ir_speckle_noise, ir_thermal_noise=ir_thermal_noise, ir_signal=None)

    def set_census_window_size(self, census_width: int, census_height: int) -> None:
        self._set(census_width=census_width, census_height=census_height)

    def set_matching_block_size(self, block_width: int, block_height: int) -> None:
        self._set(block_width=block_width, block_height=block_height)

    def set_penalties(self, p1: int, p2: int) -> None:
        self._set(p1=p1, p2=p2)

    def set_uniqueness_ratio(self, uniqueness_ratio: int) -> None:
        self._set(uniqueness_ratio=uniqueness_ratio)

    def set_lr_max_diff(self, lr_max_diff: int) -> None:
        """-1 switches the check off."""
        self._set(lr_max_diff=lr_max_diff)

    # ---- inside ----

    def _set(self, **changes: Any) -> None:
        changed = self._changed(**changes)
        self._apply(changed, engine_parameters(changed))

    def _changed(self, **changes: Any) -> StereoDepthSensorConfig:
        config = deepcopy(self._config)
        for name, value in changes.items():
            setattr(config, name, value)
        return config

    def _apply(self, config: StereoDepthSensorConfig, parameters: dict[str, Any]) -> None:
        self._match_rest()
        self._engine.set_parameters(**parameters)
        self._config, self._exposure = config, AutoExposure(config)
        self._inputs = None

    def _match(self, outputs: Any) -> dict[str, np.ndarray]:
        """These maps of the last picture; outputs: their names, or what they are written into."""
        self._engine.set_parameters(frame_index=self._taken.frame, scene_index=self._taken.speckle_draw)
        pair = (self._link.left, self._link.right)
        laser = self._link.lasers(self._taken.is_laser_apart)
        return self._image_effects.depth(self._engine, pair, outputs, **laser)

    def _match_rest(self) -> None:
        """Before the engine changes: what could still be read is computed."""
        self._results.complete(self._match)

    def _signals(self) -> list[dict[str, float]]:
        """The imagers' parameters of the last picture, left and right."""
        return [eye.signal for eye in self._tell_engines().sides]

    def make_engine(self) -> simsense.Engine:
        """Another depth engine of this rig and these parameters, a simsense.Engine."""
        return make_engine(self._config, simsense.Device(self._device.info.device_uuid))

    def _tell_engines(self) -> EngineInputs:
        """The engines' inputs, with the RGB camera at the origin; found anew where the sensor or its conditions
        have changed."""
        if self._inputs is None:
            temperature, time_s = self._conditions
            c, twist = self._config, self._twist
            frame = exposure(c, twist, time_s, temperature)
            emitter, pattern = c.emitter_power(max(self._lit_frame, 0)), self._world.pattern
            inputs = sensor_inputs(c, self._scene, Pose(), twist, frame, pattern, self._ambient_radiance, emitter)
            inputs.scene_materials = self._world.material
            self._scene_measurement.apply(inputs)
            self._left_over = apply_engine(inputs, self._effects.effects)
            cameras = [(eye.camera, eye.delay_s) for eye in inputs.sides]
            self._eye_poses = [
                moved_pose(e.camera_to_world, e.linear_velocity, e.angular_velocity, t) for e, t in cameras
            ]
            if not self._is_closed:
                self._world.enter(inputs)
                if c.projector_always_on:
                    self._world.place(self._rig.matrix())
            self._engine.set_signal(*(eye.signal for eye in inputs.sides))
            self._inputs = inputs
        return self._inputs

    def _prepare(self, frame: int) -> Taken:
        """What changes from picture to picture: exposure, emitter, and, where the sensor has moved, its static
        speckle."""
        if self._next_setting is not None:
            self._set_exposure(self._next_setting)
        if self._config.emitter == "alternating":
            self._inputs = None
        place = self._rig.matrix()
        if self._place is None or not np.array_equal(place, self._place):
            self._place, self._speckle_draw = place, self._speckle_draw + 1
        self._lit_frame = frame
        return Taken(frame, self._speckle_draw, self._tell_engines().speckle_of_laser)

    def _expose(self, link: IrLink) -> None:
        """Automatic exposure looks at the light of a picture: for the same picture, or for the next."""
        if self._exposure.mode == "fixed":
            return
        inputs = self._tell_engines()
        after = self._exposure.after(self._config, inputs.left.signal, link.first_image(), inputs.max_dn)
        if self._exposure.mode == "settled":
            self._set_exposure(after)
        else:
            self._next_setting = after

    def _set_exposure(self, setting: Any) -> None:
        if (setting.exposure_s, setting.gain) != (self._config.ir_camera_exposure, self._config.ir_camera_gain):
            self._config.ir_camera_exposure, self._config.ir_camera_gain = setting.exposure_s, setting.gain
            self._inputs = exposed_anew(self._inputs, self._config, self._effects, self._scene_measurement)
            if self._inputs is not None:
                self._engine.set_signal(*(eye.signal for eye in self._inputs.sides))
        self._next_setting = None

    def _move(self) -> None:
        """Gives the engines' inputs the present velocity."""
        if self._inputs is None or any(eye.delay_s for eye in self._inputs.sides):
            self._inputs = None
            return
        give_velocity(self._inputs, self._config, self._twist)

    def _place_projector(self) -> None:
        """The projector, and what else is on the rig, at the present pose."""
        self._tell_engines()
        self._world.place(self._rig.matrix())

    @contextmanager
    def _projector_on(self) -> Iterator[None]:
        """It shines here, and is dark afterwards, so that other sensors do not see it."""
        self._place_projector()
        try:
            yield
        finally:
            if not self._config.projector_always_on:
                self._world.darken()

    def _camera(self, size_px: Any, k: np.ndarray, pose_in_rgb: Pose, more: Any) -> kuafu.Camera:
        linear, angular = twist_of(self._config, self._twist, pose_in_rgb)
        pose = camera_to_world(Pose(self._rig.matrix() @ as_matrix(pose_in_rgb)))
        return kuafu.Camera(size_px[0], size_px[1], k, pose, linear_velocity=linear, angular_velocity=angular, **more)

    def _render(
        self, cameras: Any, outputs: Any, band: Band, frame: int, progress: Any, eyes: Any = (False, True),
        run: Any = None,
    ) -> Any:
        optics: Any = self._config.rgb_optics
        environments = None
        if band == "infrared":
            seen_by = [self._tell_engines().sides[is_right] for is_right in eyes]
            optics, environments = [eye.optics for eye in seen_by], [LATER if eye.delay_s else 0 for eye in seen_by]
        return (run or self._renderer.render)(
            self._scene, cameras, outputs, band=band, **render_settings(self._config, frame), optics=optics,
            environments=environments, projector=self._world.projector, progress=progress,
            scales={"srgb": self._config.rgb_exposure or 0.0} if "srgb" in outputs else {},
        )  # fmt: skip

    def _render_infrared(self, taken: Taken, link: IrLink, progress: Any, run: Any = None) -> Any:
        """The projector's part of both images beside them, unless all light has speckle."""
        targets = link.targets(taken.is_laser_apart)
        return self._render(self.ir_cameras(), targets, "infrared", taken.frame, progress, run=run)

    def _keep_times(self, group: str, worker: Any) -> None:
        kept = {name: t for name, t in self._stage_times.items() if not name.startswith(f"{group}: ")}
        self._stage_times = kept | {f"{group}: {name}": t for name, t in worker.stage_times.items()}
