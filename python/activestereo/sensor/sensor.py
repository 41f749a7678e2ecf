# SPDX-License-Identifier: Apache-2.0
"""StereoDepthSensor simulates an RGB camera, an infrared pair and a pattern projector in a kuafu scene, and computes
depth with simsense. Its methods have the names of SAPIEN's StereoDepthSensor."""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
import simsense
from activestereo.camera.auto_exposure import black_level
from activestereo.camera.config_limits import checked_twist
from activestereo.camera.plan import SensorPlan, matcher_parameters, plan_of, signal_parameters
from activestereo.camera.presets import StereoDepthSensorConfig, own_config
from activestereo.capture.capture import SIDES
from activestereo.common.limits import TEMPERATURE, TIME
from activestereo.common.parameter import MATCHER
from activestereo.common.pose import Pose, as_matrix, camera_to_world
from activestereo.common.progress_bar import Progress
from activestereo.common.shown import require_known, unknown
from activestereo.effects.core.engine import EngineInputs
from activestereo.model import SensorModel
from activestereo.sensor.engine import SensorEngine
from activestereo.sensor.foreign_matcher import MatcherLike
from activestereo.sensor.gbuffer.cause import traced_causes
from activestereo.sensor.image_effects import ImageEffects, ModelCostWarning
from activestereo.sensor.mounts import HasPose, RigPlace, as_mount
from activestereo.sensor.pictures import checked_radiance, dn_per_radiance
from activestereo.sensor.results import CAMERAS, SensorResults

_CHANGEABLE = {parameter.name for parameter in MATCHER} | {
    "noise_seed", "ir_signal", "ir_speckle_noise", "ir_thermal_noise", "ir_responsivity_dn", "ir_black_level_dn",
}  # fmt: skip


class StereoDepthSensor(SensorResults):
    """Simulates one active stereo depth sensor, by a SensorEngine.

    config: a StereoDepthSensorConfig, which is copied, or a camera's name. scene_or_mount: a kuafu.Scene, a Mount, or
    the path of a scene file. pose: the RGB camera's pose, in the scene or relative to the mount; body axes (x forward,
    y left, z up) as in SAPIEN. device: 'auto', 'cpu', an index or a kuafu.Device; unused if the scene has its own. The
    projector is added to the scene as an infrared light. It shines during this sensor's pictures, or always with the
    config's projector_always_on. It leaves the scene at close(), at the end of a `with` block, or with the last
    reference to the sensor. Use it in one thread at a time.

    model: a model.SensorModel or the path of a model.json. Renderer and depth engine apply its effects. Effects that
    neither computes change the images on the host, with a ModelCostWarning. The model's calibration, pattern and imager
    are not applied: use a config of StereoDepthSensorConfig.from_model(). Raises ValueError if it does not fit this
    scene; nothing has changed then.

    on_cuda: RGB pictures and maps lie in memory that CUDA can access, for get_cuda(). Raises CudaError without CUDA on
    this GPU.

    matcher: 'simsense', 'opencv', or a sensor.foreign_matcher.Matcher, which gets the pairs after simsense's imager and
    rectification. Raises ValueError with on_cuda or a model that changes the images.
    """

    def __init__(
        self, config: StereoDepthSensorConfig | str, scene_or_mount: kuafu.Scene | HasPose | str | PathLike[str],
        pose: Pose | None = None, device: str | int | kuafu.Device = "auto",
        model: SensorModel | str | PathLike[str] | None = None, on_cuda: bool = False,
        matcher: MatcherLike = "simsense",
    ) -> None:  # fmt: skip
        self._config = own_config(config)
        plan = plan_of(self._config)
        mount = as_mount(scene_or_mount, device)
        self.scene, self.device = mount.scene, mount.scene.device
        self._place = RigPlace(mount, Pose() if pose is None else pose)
        self._engine = SensorEngine(
            plan, mount.scene, model=model, source=scene_or_mount, on_cuda=on_cuda,
            matcher=matcher,
        )  # fmt: skip
        # The depth engine, and how it gets the infrared pair: 'opaque_fd' or 'host'.
        self.engine: simsense.Engine = self._engine.matcher
        self.ir_memory = self._engine.ir_memory
        self._depth_maps = tuple(self._config.depth_maps)
        if self._config.projector_always_on:
            self._engine.rig.shine(self._rigs())
        if self._engine.rig.left_over:
            self._engine.image_effects = ImageEffects(weakref.proxy(self), self._engine.rig.left_over)
            names = ", ".join(effect.id for effect, _ in self._engine.rig.left_over)
            text = f"no engine field expresses {names}: every picture is copied to the host and back"
            warnings.warn(text, ModelCostWarning, stacklevel=2)

    # ---- taking pictures ----

    def take_picture(self, infrared_only: bool = False, progress: Progress | None = None) -> None:
        """Renders the infrared pair, and before it the RGB picture unless infrared_only. progress(fraction) may return
        True to cancel. A failed or cancelled picture leaves no result."""
        self._engine.drop_pictures()
        self._engine.take_pictures(self._rigs(), infrared_only, progress)

    def compute_depth(self, maps: Sequence[str] = ()) -> None:
        """Applies noise to the last picture, matches it and registers the depth to the RGB camera. The same picture
        gives the same depth. Computes maps that were read for an earlier picture, and the named ones: 'disparity',
        'ir_left', 'ir_right' and the config's depth_maps. Others are computed when they are first read, which matches
        again."""
        require_known("map", maps, ("disparity", "ir_left", "ir_right", *self._depth_maps))
        self._engine.match(maps)

    def compute_depth_from(
        self, left: ArrayLike, right: ArrayLike, left_laser: ArrayLike | None = None,
        right_laser: ArrayLike | None = None, outputs: tuple[str, ...] = ("disparity",), frame_index: int = 0,
    ) -> dict[str, NDArray[Any]]:  # fmt: skip
        """Computes {output of simsense.Engine.compute: array} from radiance images left and right, [height, width]
        W/(sr m^2). frame_index: number of the picture whose noise is used. *_laser: the projector's part of the
        radiance, the only light with speckle; None: all light has speckle."""
        shape = self._config.ir_resolution[::-1]
        pair, lasers = checked_radiance(left, right, left_laser, right_laser, shape)
        return self._engine.compute_from(pair, outputs, lasers, frame_index)

    # ---- results ----

    def get_ir(self) -> list[NDArray[np.float32]]:
        """Returns [left, right], float32 [height, width] in 0..1: the counts, over full scale, that linear imagers
        without noise and dark current would give."""
        light, signals = self._engine.light(), self._engine.picture().signals
        return [_linear_counts(*side) for side in zip(light, signals, strict=True)]

    def get_depth_map(self, name: str) -> NDArray[Any]:
        """Returns one of the config's depth_maps: as in a batch; or, always, 'cause', uint8 [height, width] of the
        (rectified) left infrared camera, an index into gbuffer.cause.CAUSES: why a pixel has no depth, from the scene
        as it is now."""
        if name == "cause":
            return traced_causes(self, self._engine.maps.read("reason"))
        return super().get_depth_map(name)

    def get_pointcloud(self, with_rgb: bool = False) -> NDArray[np.float32]:
        """Returns the measured points, float32 [n, 3], metres in the RGB camera's axes (x right, y down, z forward).
        with_rgb: [n, 6], with colours 0..1."""
        depth = self.get_depth()
        v, u = np.nonzero(depth)
        points = (self.rgb_rays()[:, v, u] * depth[v, u]).T.astype(np.float32)
        return np.hstack([points, self.get_rgb()[v, u]]) if with_rgb else points

    def get_picture(self, name: str, camera: str = "rgb") -> NDArray[Any]:
        """Renders one of kuafu's outputs ('position', 'albedo', ...; see kuafu.Renderer) now, [height, width,
        channels], by camera 'rgb', 'left' or 'right'. Outputs projector_* are for this sensor's projector. Needs no
        take_picture()."""
        return self.get_pictures([name], camera)[name]

    def get_pictures(self, names: Sequence[str], camera: str = "rgb", **options: Any) -> dict[str, NDArray[Any]]:
        """Renders several of get_picture()'s outputs at once, {name: image}. options: arguments of
        kuafu.Renderer.render that override the sensor's own."""
        if camera not in CAMERAS:
            raise ValueError(unknown("camera", camera, CAMERAS))
        return self._engine.render_now(self._rigs(), names, None if camera == "rgb" else SIDES.index(camera), **options)

    # ---- the sensor itself ----

    def get_config(self) -> StereoDepthSensorConfig:
        config, setting = super().get_config(), self._engine.rig.setting
        config.ir_camera_exposure, config.ir_camera_gain = setting.exposure_s, setting.gain
        return config

    def get_pose(self) -> Pose:
        """Returns the RGB camera's pose in the scene (body axes)."""
        return self._place.pose()

    def set_local_pose(self, pose: Pose | NDArray[Any]) -> None:
        """Sets the RGB camera's pose relative to the mount, or in the scene if there is no mount (body axes)."""
        self._engine.rig.require_open()
        self._place.local = Pose(as_matrix(pose))

    def set_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Sets the velocity of the whole sensor, projector included, while its shutters are open; zeros = no motion.
        linear, angular: m/s and rad/s in the left infrared camera's own frame (x right, y down, z forward). The pose
        during an exposure is pose exp(t [linear, angular]), as camera_velocity of captures. The velocity does not move
        the sensor between pictures: set_local_pose() sets the pose in the middle of the exposure."""
        self._engine.rig.set_twist(checked_twist(linear, angular))

    def set_conditions(self, temperature_c: float | None = None, time_s: float = 0.0) -> None:
        """Sets conditions that a model's effects may depend on in the next pictures: the sensor's temperature (None:
        that of its signal) and the seconds since it was switched on."""
        if temperature_c is not None:
            TEMPERATURE.check("temperature_c", temperature_c)
        TIME.check("time_s", time_s)
        self._engine.set_conditions(None if temperature_c is None else float(temperature_c), float(time_s))

    @property
    def plan(self) -> SensorPlan:
        """Returns the configuration as arguments of the renderer and the depth engine."""
        return self._engine.plan

    def make_engine(self) -> simsense.Engine:
        """Returns a new depth engine with this sensor's calibration and parameters."""
        return self._engine.rig.make_matcher(1)

    def engine_inputs(self) -> EngineInputs:
        """Returns the cameras, lights and parameters that renderer and depth engine get under the model, with the
        infrared cameras at their present poses."""
        self.ir_cameras()
        return self._engine.rig.inputs()

    @property
    def projector_to_world(self) -> NDArray[np.float64]:
        """Returns 4x4, from the projector's own axes to the scene's, metres."""
        return self._place.matrix() @ camera_to_world(self._config.pose_rgb_irproj)

    def rgb_camera(self) -> kuafu.Camera:
        return self._engine.rig.rgb_cameras(self._rigs())[0]

    def ir_cameras(self) -> list[kuafu.Camera]:
        """Returns the left and the right camera at their true poses, which a model may move off the calibration."""
        return self._engine.rig.ir_cameras(self._rigs())

    # ---- parameters ----

    def change(self, **changes: Any) -> None:
        """Changes fields of the configuration that the matcher or the noise depends on. Setting ir_speckle_noise or
        ir_thermal_noise removes ir_signal, so that SAPIEN's noise applies. Raises ValueError for an invalid value, and
        for fields that pictures depend on; nothing has changed then."""
        before, config = self.get_config(), self.get_config()
        if not {"ir_speckle_noise", "ir_thermal_noise"}.isdisjoint(changes):
            config.ir_signal = None
        elif changes.get("ir_signal") is not None:
            config.ir_speckle_noise = config.ir_thermal_noise = 1.0
        for name, value in changes.items():
            setattr(config, name, value)
        if fixed := [name for name in config.differing(before) if name not in _CHANGEABLE]:
            raise ValueError(f"{', '.join(fixed)} of a sensor cannot change: make a new sensor")
        config.check()
        matcher = matcher_parameters(config)
        if config.noise_seed != before.noise_seed:
            matcher["noise_seed"] = config.noise_seed
        self._engine.set(matcher, signal_parameters(config))
        self._config = config

    # ---- inside ----

    def _poses(self) -> NDArray[np.float64]:
        return self._place.matrix()

    def _rigs(self) -> NDArray[np.float64]:
        """Returns the RGB camera's pose, [1, 4, 4], body axes."""
        return self._place.matrix()[None]


def _linear_counts(image: NDArray[np.float32], signal: dict[str, float]) -> NDArray[np.float32]:
    """Returns the counts over full scale, 0..1, that a linear imager without noise and dark current gives for an image
    of radiance, W/(sr m^2)."""
    full_scale_dn, per_radiance = 2 ** signal["bit_depth"] - 1, dn_per_radiance(signal)
    black = np.float32(black_level(signal) / full_scale_dn)
    return np.clip(image * np.float32(per_radiance / full_scale_dn) + black, 0.0, 1.0)
