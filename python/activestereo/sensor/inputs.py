# SPDX-License-Identifier: Apache-2.0
"""EngineInputs of a simulated sensor: what its configuration tells the engines for one exposure, before a model's
effects; and a model's effects with the names of a scene's surfaces."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.matching import render_parameters, signal_parameters
from activestereo.capture.capture import Frame
from activestereo.common.lens import lens_fields
from activestereo.common.pose import Pose, camera_to_camera, camera_to_world, carried_twist
from activestereo.effects.core.engine import EngineCamera, EngineInputs
from activestereo.effects.core.model import Model
from activestereo.effects.core.scene_surfaces import split_surfaces
from activestereo.effects.engines.scene_measurement import SceneMeasurement
from activestereo.model import SensorModel, read_model

if TYPE_CHECKING:
    from activestereo.camera.presets import StereoDepthSensorConfig

# Media reach so far beyond scene and rig.
_MARGIN_M = 0.05
# A collimated beam is in focus here: a dot is the beam's width in metres beside its angle.
_FAR_M = 1e6
# Inputs are those of a sensor whose RGB camera is at the origin.
_RGB_POSE = Pose()


def sensor_inputs(
    config: StereoDepthSensorConfig, scene: kuafu.Scene, twist: NDArray[np.float64], temperature_c: float | None,
    time_s: float, pattern: NDArray[np.float32] | None, ambient_radiance: float, emitter: float,
) -> EngineInputs:  # fmt: skip
    """A sensor with its RGB camera at the origin; twist: of the left camera in its own axes, m/s and rad/s.
    temperature_c and time_s: of its exposure. pattern: None where the sensor has no projector or projects dots.
    emitter: the laser's power over its nominal one."""
    frame = Frame(
        id=0, left_path=None, right_path=None, timestamp_s=time_s, exposure_s=config.ir_camera_exposure,
        camera_to_world=np.eye(4), split="train", temperature_c=temperature_c, camera_velocity=twist,
    )  # fmt: skip
    signal = _signal(config, frame)
    summary = scene.summary
    inputs = EngineInputs(
        left=_camera(config, dict(signal), is_right=False),
        right=_camera(config, dict(signal), is_right=True),
        projector=_projector(config, pattern, emitter),
        pattern=pattern,
        frame=frame,
        new_light=kuafu.Light,
        new_medium=kuafu.Medium,
        scene_materials=scene.get_material,
        material_count=summary.material_count,
        bounds_m=_bounds(summary),
        max_dn=float(2 ** int(signal["bit_depth"]) - 1),
        seed=config.noise_seed,
        ambient_radiance=ambient_radiance,
        speckle_of_laser=bool(config.ir_speckle_of_laser),
    )
    give_velocity(inputs, config, twist)
    return inputs


def exposed_anew(
    inputs: EngineInputs | None, config: StereoDepthSensorConfig, effects: Model, scene_measurement: SceneMeasurement
) -> EngineInputs | None:
    """The inputs under the configuration's present exposure and gain; None where they have to be found again: where
    there are none yet, or effects or a scene measurement, which may depend on the exposure, have touched them."""
    if inputs is None or effects.effects or scene_measurement != SceneMeasurement():
        return None
    inputs.frame = replace(inputs.frame, exposure_s=config.ir_camera_exposure)
    for side in inputs.sides:
        side.signal = _signal(config, inputs.frame)
        side.camera.exposure_s = config.ir_camera_exposure
    return inputs


def twist_of(config: StereoDepthSensorConfig, twist: NDArray[np.float64], pose_in_rgb: Pose) -> NDArray[np.float64]:
    """[2, 3] linear and angular velocity, in its own camera axes, of what stands at this place of the sensor."""
    if not np.any(twist):  # as nearly always; each picture under automatic exposure asks
        return np.zeros((2, 3))
    return carried_twist(camera_to_camera(config.trans_pose_l, pose_in_rgb), twist).reshape(2, 3)


def give_velocity(inputs: EngineInputs, config: StereoDepthSensorConfig, twist: NDArray[np.float64]) -> None:
    """Lets all that is on the rig move as the left camera does; twist as sensor_inputs() has it."""
    for record, place in ((inputs.left.camera, config.trans_pose_l), (inputs.right.camera, config.trans_pose_r)):
        record.linear_velocity, record.angular_velocity = twist_of(config, twist, place)
    for light in ([] if inputs.projector is None else [inputs.projector]) + inputs.rig_lights:
        light.linear_velocity, light.angular_velocity = twist_of(config, twist, config.pose_rgb_irproj)


def render_settings(config: StereoDepthSensorConfig, frame: int) -> dict[str, Any]:
    """Keyword arguments of kuafu.Renderer.render that follow from the configuration alone."""
    return render_parameters(config) | {"seed": (config.render_seed << 32) + frame}


def shutter(line_time_s: float, readout: str) -> dict[str, Any]:
    """kuafu.Camera's fields of a rolling shutter, none for a global one."""
    return {"shutter": "rolling", "line_time_s": line_time_s, "readout": readout} if line_time_s else {}


def _signal(config: StereoDepthSensorConfig, frame: Frame) -> dict[str, float]:
    signal = signal_parameters(config)
    return signal if frame.temperature_c is None else signal | {"temperature_c": frame.temperature_c}


def _camera(config: StereoDepthSensorConfig, signal: dict[str, float], is_right: bool) -> EngineCamera:
    k, distortion = config.ir_intrinsics(is_right)
    width, height = config.ir_resolution
    camera = kuafu.Camera(
        width, height, k, camera_to_world(_RGB_POSE * (config.trans_pose_r if is_right else config.trans_pose_l)),
        **lens_fields(distortion), exposure_s=config.ir_camera_exposure,
        **shutter(config.ir_line_time_s, config.ir_readout),
    )  # fmt: skip
    return EngineCamera(camera, kuafu.Optics(**(config.ir_optics or {})), signal, is_right)


def _projector(
    config: StereoDepthSensorConfig, pattern: NDArray[np.float32] | None, emitter: float
) -> kuafu.Light | None:
    fields: dict[str, Any]
    if config.light_dots is not None:
        design = config.pattern_design
        size = {"pattern_width": design.width, "pattern_height": design.height, "dot_sigma_px": design.dot_sigma_px}
        size["dot_background"] = config.light_dot_background
        fields = {"dots": config.light_dots, "k": config.pattern_k(design.width, design.height), **size}
    elif pattern is None:
        return None
    else:
        fields = {"k": config.pattern_k(pattern.shape[1], pattern.shape[0])}
    if config.projector_beam_radius_m > 0.0:
        fields |= {"radius_m": config.projector_beam_radius_m, "focus_m": _FAR_M}
    return kuafu.Light(
        kind="projector",
        name="projector",
        ir_intensity=config.projector_intensity * emitter,
        falloff=config.projector_falloff,
        pattern_scale=config.light_pattern_scale,
        light_to_world=camera_to_world(_RGB_POSE * config.pose_rgb_irproj),
        **fields,
    )


def _bounds(summary: kuafu.SceneSummary) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Corners of the box, metres, that holds the scene and the sensor."""
    corners = [summary.bounds_min_m, summary.bounds_max_m] if summary.triangle_count else []
    points = np.array([*corners, _RGB_POSE.p])
    return tuple(points.min(axis=0) - _MARGIN_M), tuple(points.max(axis=0) + _MARGIN_M)


def fitted_to(
    scene: kuafu.Scene, source: object, model: SensorModel | str | PathLike[str] | None, config: StereoDepthSensorConfig
) -> tuple[Model, SceneMeasurement, float]:
    """(effects, scene measurement, infrared radiance of the model's room) in this scene. source: what the scene is
    from; where the model tells two objects of one material apart and it is a file's path, each gets a material of its
    own."""
    if model is None:
        return Model(), SceneMeasurement(), config.ir_ambient_radiance
    model = model if isinstance(model, SensorModel) else read_model(Path(model))
    names = _material_names(scene)
    if isinstance(source, (str, PathLike)) and not model.surfaces <= set(names):
        split_surfaces(scene, Path(source))
        names = _material_names(scene)
    ambient = model.nuisances.get("ambient_scale")
    radiance = config.ir_ambient_radiance if ambient is None else ambient.value / config.ir_responsivity_dn
    return model.bound(names), model.scene_measurement(names), radiance


def _material_names(scene: kuafu.Scene) -> list[str]:
    return [scene.material_name(number) for number in range(scene.summary.material_count)]
