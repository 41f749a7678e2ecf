# SPDX-License-Identifier: Apache-2.0
"""Sensor configurations: StereoDepthSensorConfig("D435"), or another camera of camera/data. The camera's file has every
figure with its source ('activestereo presets' prints them). Fields have SAPIEN's names; new ones follow SAPIEN's style.
The cameras "sapien-D435" and "sapien-D415" have SAPIEN's values, too.

Exposure: a pixel's noise-free count is ir_camera_exposure * ir_camera_gain * ir_responsivity_dn * radiance, plus the
black level. Real cameras' configurations expose automatically (auto_exposure.py). SAPIEN's have a fixed exposure: a
mean dot reaches about 130 counts at 1 m on a surface of albedo 0.5."""

from __future__ import annotations

from copy import deepcopy
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.camera_file import FIELDS, CameraData, camera_titles, read_camera
from activestereo.camera.config_limits import (
    Calibrated,
    Emitter,
    ExposureMode,
    Readout,
    check_field,
    check_matrix,
    check_together,
)
from activestereo.common.limits import SIDE, Limits
from activestereo.common.parameter import MATCHER, RENDER, RENDERER, RIG
from activestereo.common.parameter_types import MatcherFields, RenderFields
from activestereo.common.pattern import PatternDesign
from activestereo.common.pose import Pose, as_matrix, rigid_motion
from activestereo.common.shown import did_you_mean, shown

if TYPE_CHECKING:
    from activestereo.capture.capture import Frame
    from activestereo.model import SensorModel


def _k(fx: float, fy: float, cx: float, cy: float) -> np.ndarray:
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _pose(camera: CameraData, name: str) -> Pose:
    rotation = np.reshape(camera.value("rig", "ir_rotation"), (3, 3))
    return Pose(rigid_motion(camera.value("rig", name), rotation))


def _signal(camera: CameraData) -> dict[str, float] | None:
    """Returns simsense's imager parameters from the noise figures in the camera's file. Returns None if the file has
    none; SAPIEN's noise then applies."""
    imager = camera.figures["imager"]
    if "conversion_gain_dn_per_e" not in imager:
        return None
    gain, contrast = camera.value("imager", "conversion_gain_dn_per_e"), camera.value("imager", "speckle_contrast", 0.0)
    signal = {
        "responsivity_e": 1.0 / gain,
        "conversion_gain_dn_per_e": gain,
        "shot_noise": 1.0,
        "adc_noise_dn": camera.value("imager", "adc_noise_dn", 0.0),
        "prnu": camera.value("imager", "prnu", 0.0),
        "extra_bits": int(camera.value("imager", "extra_bits", 0)),
    }
    if contrast > 0.0:
        signal |= {
            "speckle_shape": contrast**-2,
            "speckle_scale": contrast**2,
            "speckle_correlation": camera.value("imager", "speckle_correlation", 0.0),
            "speckle_psf_sigma_px": camera.value("imager", "speckle_psf_sigma_px", 0.0),
        }
    return signal


# SAPIEN's names of the engines' parameters, which a configuration accepts, too, and the defaults that differ.
SAPIEN_NAMES = {
    "noise_seed": "ir_noise_seed",
    "max_disparity": "max_disp",
    "p1": "p1_penalty",
    "p2": "p2_penalty",
    "median_size": "median_filter_size",
    "min_depth_m": "min_depth",
    "max_depth_m": "max_depth",
    "ir_ambient_scale": "ir_light_dim_factor",
    "ir_ambient_radiance": "ir_ambient_strength",
}
SAPIEN_DEFAULTS = {"depth_dilation": True}
# Engine parameters that belong to a camera, with the section of its data.
OF_THE_CAMERA = {
    "min_depth_m": "rig",
    "max_depth_m": "rig",
    "max_disparity": "rig",
    "ir_ambient_scale": "room",
    "ir_ambient_radiance": "room",
    "denoise": "room",
    **dict.fromkeys(FIELDS["matcher"], "matcher"),
}


FIELD_OF_VIEW = Limits(1.0, 170.0, "degrees")
_LEAST_WINDOW = 0.45  # of the full one's side: tests/bench/bench_invented.py at 128x128
_LEAST_BLOCK_PX = 7  # side of a block of summed costs: that of a census window


_OWN_NAMES = {sapien: own for own, sapien in SAPIEN_NAMES.items()}


class StereoDepthSensorConfig(MatcherFields, RenderFields):
    """All settings of a sensor; change any field before making the sensor. model: a camera's name, or the path of a
    TOML file like those of camera/data. Raises ValueError for an unknown model or an invalid value, AttributeError for
    an unknown field."""

    SUPPORTED_MODELS = tuple(camera_titles())
    _FIELDS: tuple[str, ...] = ()  # all names, once a first one has been made
    _calibrated: Calibrated  # of the camera's data, or of scaled()
    _scale: float  # of the images, to those of the camera's data

    def __init__(self, model: str = "D435") -> None:
        camera = read_camera(model)
        self.model = camera.name

        # Cameras. Resolutions are (width, height); poses are those of the IR cameras and the projector in the RGB
        # camera's body frame (x forward, y left, z up).
        self.rgb_resolution: tuple[int, int] = camera.value("rig", "rgb_resolution")
        self.ir_resolution: tuple[int, int] = camera.value("rig", "ir_resolution")
        self.rgb_intrinsic: NDArray[np.float64] = _k(*camera.value("rig", "rgb_intrinsic"))
        self.ir_intrinsic: NDArray[np.float64] = _k(*camera.value("rig", "ir_intrinsic"))
        self.trans_pose_l = _pose(camera, "left_position_m")
        self.trans_pose_r = _pose(camera, "right_position_m")
        # Lenses as in OpenCV: Brown and Conrady's k1, k2, p1, p2, k3 and, for a rational lens, k4, k5, k6; or k1, k2,
        # k3, k4 of a fisheye lens. Both IR cameras have the same one. rectified: the infrared pair is matched as it
        # comes, its rows aligned; a pair with a distorting lens is rectified first all the same.
        self.ir_distortion: tuple[float, ...] = (0.0,) * 5
        # The right IR camera's matrix and lens; None = the left one's.
        self.ir_intrinsic_right: NDArray[np.float64] | None = None
        self.ir_distortion_right: tuple[float, ...] | None = None
        self.rgb_distortion: tuple[float, ...] = (0.0,) * 5
        self.rectified = True

        # Projector. active_light_fov: the pattern image's horizontal angle, radians. light_pattern: "generated" from
        # pattern_design, an 8-bit gray array, the path of an image, or None for no projector.
        self.pose_rgb_irproj = _pose(camera, "projector_position_m")
        self.active_light_fov = float(np.deg2rad(camera.value("projector", "field_of_view_deg")))
        has_projector = camera.value("projector", "has_projector", True)
        self.light_pattern: NDArray[np.uint8] | str | PathLike[str] | None = "generated" if has_projector else None
        # The pattern image's 3x3 camera matrix, which replaces active_light_fov; None = no replacement.
        self.pattern_intrinsic: NDArray[np.float64] | None = None
        figures = {
            name: camera.value("projector", name)
            for name in ("dot_pitch_px", "dot_sigma_px", "weakest_dot", "background")
        }
        width, height = camera.value("projector", "pattern_size")
        self.pattern_design = PatternDesign(
            width, height, seed=camera.value("projector", "pattern_seed"),
            focal_px=float(0.5 * width / np.tan(0.5 * self.active_light_fov)),
            lattice_angles_deg=camera.value("projector", "lattice_angles_deg", ()), **figures,
        )  # fmt: skip
        # Replaces light_pattern: [n, 3] u, v and power of dots, in pixels of pattern_design's image and with its
        # dot_sigma_px. A dot's power is the pattern's integral over it, in pixels squared. light_pattern_scale
        # magnifies the pattern about its middle; light_dot_background is the value of every pixel without dots.
        self.light_dots: NDArray[np.float32] | None = None
        self.light_dot_background = 0.0
        self.light_pattern_scale = 1.0
        self.projector_intensity: float = camera.value("projector", "intensity_w_sr")  # W/sr at pattern value 1
        # The laser's setting: light goes with laser_power_mw over laser_power_nominal_mw. emitter: 'on', 'off', or
        # 'alternating' (on in every even picture, as librealsense's emitter on-off).
        self.laser_power_mw: float = camera.value("projector", "laser_power_mw")
        self.laser_power_nominal_mw: float = self.laser_power_mw
        self.laser_power_limits_mw: tuple[float, float, float] = camera.value("projector", "laser_power_limits_mw")
        self.emitter: Emitter = "on"
        # A dot's beam has this width at the projector; 0 = only its angle widens it. Dots fall off with this power of
        # the cosine from the projector's axis.
        self.projector_beam_radius_m: float = camera.value("projector", "beam_radius_m", 0.0)
        self.projector_falloff: float = camera.value("projector", "falloff", 0.0)
        # True: other sensors of the scene also see this projector's dots, as real sensors do.
        self.projector_always_on = False

        # Exposure and infrared light. ir_camera_exposure in seconds; ir_responsivity_dn in counts per W s / (sr m^2).
        # ir_exposure_mode: 'fixed'; 'converging': after each picture exposure, then gain, take a step towards a mean
        # count of ir_exposure_target_dn in ir_exposure_region (left, top, right, bottom; None = the whole left image);
        # 'settled': each picture has the end of such steps, as if the camera had looked at this view for a while.
        self.ir_camera_exposure: float = camera.value("exposure", "exposure_s")
        self.ir_camera_gain: float = camera.value("exposure", "gain")
        self.ir_exposure_mode: ExposureMode = camera.value("exposure", "mode")
        self.ir_exposure_target_dn: float = camera.value("exposure", "target_dn")
        self.ir_exposure_region: tuple[int, int, int, int] | None = None
        self.ir_exposure_limits_s: tuple[float, float] = camera.value("exposure", "exposure_limits_s")
        self.ir_gain_limits: tuple[float, float] = camera.value("exposure", "gain_limits")
        self.ir_responsivity_dn: float = camera.value("imager", "responsivity_dn")
        self.rgb_exposure: float | None = (
            None  # colour value per radiance; None = the median lit pixel at a quarter of white
        )

        # Shutters, which blur motion (the sensor's by set_velocity(), instances' and lights' by kuafu.Scene). The IR
        # cameras open for ir_camera_exposure, the RGB camera for rgb_exposure_s, seconds, centred on the same instant.
        # A line time is the delay in seconds from one line to the next; 0 = a global shutter. A readout is the order of
        # lines: 'rows_down', 'rows_up', 'columns_right' or 'columns_left'.
        self.rgb_exposure_s = 0.0
        self.ir_line_time_s: float = camera.value("rig", "line_time_s")
        self.rgb_line_time_s = 0.0
        self.ir_readout: Readout = "rows_down"
        self.rgb_readout: Readout = "rows_down"

        self.ir_black_level_dn: float = camera.value("imager", "black_level_dn")  # counts in the dark

        # Noise: 1 is SAPIEN's level (a gamma factor of 2.7 % and 0.25 counts), 0 for ir_speckle_noise switches both
        # off.
        self.noise_seed = 0
        self.ir_speckle_noise = 1.0
        self.ir_thermal_noise = 1.0
        # Light with speckle, also for ir_signal. False = all light, as in SAPIEN and the paper. True = the projector's
        # alone, which is coherent (two more images are rendered and copied to the engine).
        self.ir_signal: Any = _signal(camera)
        self.ir_speckle_of_laser = bool(self.ir_signal and "speckle_shape" in self.ir_signal)
        # Replaces that noise: 'd435', 'paper-d415' or another of simsense.signal_preset, or a dict of simsense_signal's
        # parameters whose input is in counts; exposure, responsivity and black level above apply, too. (Set above, with
        # the devices' own noise.)

        # Further settings of the engines (capi/generation/reference.md): all parameters of matching and depth, the
        # depth engine's device and its options for the published SimSense's faults, the ray tracer, and the rendering.
        for p in (*MATCHER, *RIG, *RENDERER, *RENDER):
            setattr(self, p.name, SAPIEN_DEFAULTS.get(p.name, p.default))
        for name, section in OF_THE_CAMERA.items():
            setattr(self, name, camera.value(section, name, getattr(self, name)))
        self.render_seed = 0
        # Further maps of compute_depth(): 'confidence', 'reason', 'points', 'rectified_left' and 'rectified_right'.
        # Read them with get_depth_map().
        self.depth_maps: tuple[str, ...] = ()

        # Optics of the cameras: a dict of kuafu.Optics' fields (vignetting_exponent, psf_sigma_px, ...); None = perfect
        # optics.
        self.ir_optics: dict[str, Any] | None = {
            name: figure.value for name, figure in camera.figures["optics"].items()
        } or None
        self.rgb_optics: dict[str, Any] | None = None
        object.__setattr__(self, "_scale", 1.0)
        self._keep_calibration()

    def _keep_calibration(self) -> None:
        kept = {}
        for camera in ("rgb", "ir"):
            k = getattr(self, f"{camera}_intrinsic")
            kept[camera] = (tuple(getattr(self, f"{camera}_resolution")), k, np.array(k))
        object.__setattr__(self, "_calibrated", kept)

    def check(self) -> None:
        """Raises ValueError if fields contradict one another, such as a matrix for another resolution or a power beyond
        the laser's limits. Sensors call it when they are made."""
        check_together(vars(self))

    @classmethod
    def _unknown(cls, name: str) -> str:
        return f"a sensor's configuration has no field {shown(name)}{did_you_mean(name, cls._FIELDS)}"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, StereoDepthSensorConfig):
            return NotImplemented
        return not self.differing(other)

    def __repr__(self) -> str:
        """Shows the model and the fields that differ from its defaults."""
        try:
            base = type(self)(self.model)
        except ValueError:  # the path of a user's file
            return f"<StereoDepthSensorConfig of '{self.model}', {self.ir_resolution[0]}x{self.ir_resolution[1]}>"
        changed = [repr(self.model)]
        for name in self.differing(base):
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                value = value.tolist() if value.size <= 9 else f"<{value.dtype} {list(value.shape)}>"
                changed.append(f"{name}={value}")
            else:
                changed.append(f"{name}={value!r}")
        return f"StereoDepthSensorConfig({', '.join(changed)})"

    def differing(self, other: StereoDepthSensorConfig) -> list[str]:
        """Lists the fields whose values differ from those of `other`."""
        names = []
        for name in self._FIELDS:
            a, b = getattr(self, name), getattr(other, name)
            if isinstance(a, Pose) and isinstance(b, Pose):
                a, b = as_matrix(a), as_matrix(b)
            is_array = isinstance(a, np.ndarray) or isinstance(b, np.ndarray)
            if not (np.array_equal(a, b) if is_array else a == b):
                names.append(name)
        return names

    if not TYPE_CHECKING:  # type checkers know the fields by their own names alone, and so find misspelt ones

        def __getattr__(self, name: str) -> Any:
            """Returns the field whose name in SAPIEN is `name`."""
            if name in _OWN_NAMES:
                return getattr(self, _OWN_NAMES[name])
            if name.startswith("__"):  # names that Python asks for, in copy() for one: no guess
                raise AttributeError(name)
            raise AttributeError(self._unknown(name))

        def __setattr__(self, name: str, value: Any) -> None:
            name = _OWN_NAMES.get(name, name)
            if self._FIELDS and name not in self._FIELDS:
                raise AttributeError(self._unknown(name))
            check_field(name, value)
            if name.endswith("_intrinsic") and "_calibrated" in vars(self):
                check_matrix(name, value, vars(self))
            object.__setattr__(self, name, value)

    @classmethod
    def from_model(
        cls, model: SensorModel | str | Path, base: str = "D435", frame: Frame | None = None
    ) -> StereoDepthSensorConfig:
        """Makes a sensor's configuration from a sensor model, a SensorModel or the path of a model.json. Values that
        the model lacks come from the preset `base`, scaled to the model's image size. Give the model to the sensor,
        too: StereoDepthSensor(config, scene, model=model). frame: of the capture that the model was fitted to; it sets
        exposure, laser and light, so that an infrared radiance of 1 is the room's."""
        from activestereo.model import SensorModel, read_model
        from activestereo.model.configure import configured, exposed

        config = cls(base)
        known = model if isinstance(model, SensorModel) else read_model(model)
        if known.rig is not None:
            config = config.scaled(known.rig.left.width / config.ir_resolution[0])
        own = vars(config)
        for name, value in (configured(own, known) if frame is None else exposed(own, known, frame)).items():
            setattr(config, name, value)
        return config

    @property
    def focal_baseline_px_m(self) -> float:
        """Focal length times baseline of the infrared pair, in pixel metres. Divided by a disparity it gives depth."""
        baseline_m = np.linalg.norm(self.trans_pose_r.p - self.trans_pose_l.p)
        return float(self.ir_intrinsic[0, 0] * baseline_m)

    @property
    def baseline_m(self) -> float:
        return self.focal_baseline_px_m / float(self.ir_intrinsic[0, 0])

    def seen_from_left(self) -> StereoDepthSensorConfig:
        """Returns a copy whose RGB camera has the left infrared camera's pose, resolution and lens, so that depth is
        registered to the left image."""
        out, to_left = deepcopy(self), self.trans_pose_l.inv()
        out.trans_pose_l = Pose()
        out.trans_pose_r, out.pose_rgb_irproj = to_left * self.trans_pose_r, to_left * self.pose_rgb_irproj
        out.rgb_resolution, out.rgb_distortion = self.ir_resolution, self.ir_distortion
        out.rgb_intrinsic = np.array(self.ir_intrinsic)
        return out

    def scaled(self, factor: float) -> StereoDepthSensorConfig:
        """Returns a copy whose images and disparity range are `factor` times as large. Fields of view, readout times,
        projector and depth range stay. The matcher's block shrinks with the images, but not below 7 pixels, and never
        grows. Below half the size, images are blurred by half a pixel, or tiny dots would alias."""
        if not 0.0 < factor <= 100.0:
            raise ValueError(f"a sensor is scaled by a factor above 0 and up to 100, not {factor}")
        out = self._rescaled(factor)
        for camera in ("rgb", "ir"):
            old = np.array(getattr(self, f"{camera}_resolution"))
            new = np.maximum(np.rint(old * factor).astype(int), 1)
            self._resize(out, camera, (int(new[0]), int(new[1])), new / old)
        out._keep_calibration()
        return out

    def resized(self, width: int, height: int, fov: float | None = None) -> StereoDepthSensorConfig:
        """Returns a copy whose images are all width x height pixels; pixels keep their aspect ratio. fov: horizontal
        field of view of all cameras, degrees. None keeps each camera's own, and the new height crops or extends the
        image. The disparity range and the matcher's block scale with the infrared focal length, as in scaled()."""
        for name, side in (("width", width), ("height", height)):
            SIDE.check(name, side)
        if fov is not None:
            FIELD_OF_VIEW.check("fov", fov)
        focal = {}
        for camera in ("rgb", "ir"):
            old_fx = getattr(self, f"{camera}_intrinsic")[0, 0]
            own = width / getattr(self, f"{camera}_resolution")[0]
            focal[camera] = own if fov is None else 0.5 * width / np.tan(0.5 * np.deg2rad(fov)) / old_fx
        out = self._rescaled(focal["ir"])
        for camera, ratio in focal.items():
            self._resize(out, camera, (width, height), np.full(2, ratio))
        out._keep_calibration()
        return out

    def _rescaled(self, factor: float) -> StereoDepthSensorConfig:
        """Returns a copy with matcher and speckle adapted to a focal length, in pixels, `factor` times as large."""
        self.check()
        out = deepcopy(self)
        object.__setattr__(out, "_scale", self._scale * factor)
        was_small, is_small = (scale < 0.4999 for scale in (self._scale, out._scale))
        if is_small != was_small:  # to half the size imagers bin pixels, which do not overlap
            out.pixel_blur_px = 0.5 if is_small else 0.0  # with less dots fold over, with more they drown
        out.max_disparity = max(32, round(self.max_disparity * factor))
        out.block_width, out.block_height = (
            min(side, max(_LEAST_BLOCK_PX, 2 * int(0.5 * side * factor) + 1))
            for side in (self.block_width, self.block_height)
        )
        # Smaller images show more of a thing in as many pixels, but dots blur into one another.
        before, after = (max(_LEAST_WINDOW, min(1.0, scale) ** 0.5) for scale in (self._scale, out._scale))
        side = self.detection_window * after / before
        out.detection_window = min(self.detection_window, max(5, 2 * int(0.5 * side) + 1))
        out.speckle_max_size = round(out.speckle_max_size * factor**2)  # an area
        if isinstance(out.ir_signal, dict) and "speckle_psf_sigma_px" in out.ir_signal:
            grain_px = factor * out.ir_signal["speckle_psf_sigma_px"]
            out.ir_signal["speckle_psf_sigma_px"] = grain_px if grain_px >= 0.1 else 0.0  # less is a pixel's own
        return out

    def _resize(
        self, out: StereoDepthSensorConfig, camera: str, size: tuple[int, int], focal: NDArray[np.float64]
    ) -> None:
        """Sets camera 'rgb' or 'ir' of `out` to another resolution. focal: ratios of new to old focal lengths, x and
        y."""
        ratio = np.array(size) / np.array(getattr(self, f"{camera}_resolution"))
        setattr(out, f"{camera}_resolution", size)
        for name in [f"{camera}_intrinsic"] + (
            ["ir_intrinsic_right"] if camera == "ir" and self.ir_intrinsic_right is not None else []
        ):
            k = getattr(self, name).copy()
            k[:2, :2] *= focal[:, None]
            k[:2, 2] = (k[:2, 2] + 0.5) * ratio - 0.5  # pixel centres are at integers: the image's corner is at -0.5
            setattr(out, name, k)
        if camera == "ir" and self.ir_exposure_region is not None:
            left, top, right, bottom = self.ir_exposure_region
            x, y = ratio
            out.ir_exposure_region = (round(left * x), round(top * y), round(right * x), round(bottom * y))
        optics = getattr(self, f"{camera}_optics")
        if optics is not None:
            setattr(out, f"{camera}_optics", {n: v * focal[0] if n.endswith("_px") else v for n, v in optics.items()})
        lines = 0 if "columns" in getattr(self, f"{camera}_readout") else 1
        setattr(out, f"{camera}_line_time_s", getattr(self, f"{camera}_line_time_s") / ratio[lines])


def own_config(config: StereoDepthSensorConfig | str | PathLike[str]) -> StereoDepthSensorConfig:
    """Returns a copy of a configuration, or a new one for a camera's name or file. Raises TypeError for anything
    else."""
    if isinstance(config, (str, PathLike)):
        return StereoDepthSensorConfig(str(config))
    if not isinstance(config, StereoDepthSensorConfig):
        raise TypeError(f"config is {config!r:.80}, expected a StereoDepthSensorConfig or the name of a camera")
    return deepcopy(config)


StereoDepthSensorConfig._FIELDS = tuple(name for name in vars(StereoDepthSensorConfig()) if name[0] != "_")
