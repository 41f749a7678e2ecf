"""Sensor presets: StereoDepthSensorConfig("D435") or ("D415"). Names and defaults are SAPIEN's; what SAPIEN has no name
for follows them.

Exposure. A pixel's noise-free count is ir_camera_exposure * ir_responsivity_dn * radiance, plus the black level. The
projector's peak of 3 W/sr is the D435's 360 mW, spread over its field with one dot in 80 pixels. On a surface of albedo
0.5 that faces the sensor a mean dot then reaches about 130 counts at 1 m and 60 at 1.5 m, and clips below 0.75 m, as on
the devices; a table top, which is seen at a slant, is well exposed from 0.5 m to 1.5 m (a quarter of a percent of the
example's pixels clip). Real devices adapt their exposure; these do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.matcher_table import MATCHER, MatcherFields
from activestereo.pattern import PatternDesign, make_pattern
from activestereo.pose import Pose

if TYPE_CHECKING:
    from activestereo.sensor_model import SensorModel

# Calibration of one D435, as in SAPIEN: both IR cameras are turned alike against the RGB camera, by 0.9 degrees.
_D435_IR_ROTATION = [
    [0.9999489188194275, 0.009671091102063656, 0.0029452370945364237],
    [-0.009709948673844337, 0.999862015247345, 0.013478035107254982],
    [-0.0028144833631813526, -0.013505944050848484, 0.9999048113822937],
]


def _d435_pose(x: float, y: float, z: float) -> Pose:
    matrix = np.eye(4)
    matrix[:3, :3] = _D435_IR_ROTATION
    matrix[:3, 3] = x, y, z
    return Pose(matrix)


def _k(fx: float, fy: float, cx: float, cy: float) -> np.ndarray:
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _d415() -> dict[str, Any]:
    return {
        "rgb_resolution": (1920, 1080),
        "ir_resolution": (1280, 720),
        "rgb_intrinsic": _k(1380.0, 1380.0, 960.0, 540.0),
        "ir_intrinsic": _k(920.0, 920.0, 640.0, 360.0),
        "trans_pose_l": Pose([0.0, -0.0175, 0.0]),
        "trans_pose_r": Pose([0.0, -0.0720, 0.0]),
        "pose_rgb_irproj": Pose(),
        "active_light_fov": 1.57,
        "pattern_design": PatternDesign(width=1920, height=1080, dot_pitch_px=14.6, dot_sigma_px=1.75, seed=2),
    }


def _d435() -> dict[str, Any]:
    return {
        "rgb_resolution": (848, 480),
        "ir_resolution": (848, 480),
        "rgb_intrinsic": _k(605.12158203125, 604.905517578125, 424.5927734375, 236.668975830078),
        "ir_intrinsic": _k(430.139801025391, 430.139801025391, 425.162841796875, 235.276519775391),
        "trans_pose_l": _d435_pose(0.00015650546993128955, -0.014897654764354229, -1.1531494237715378e-05),
        "trans_pose_r": _d435_pose(-0.0003285693528596312, -0.06504792720079422, 0.0006658887723460793),
        "pose_rgb_irproj": _d435_pose(0.0, -0.044, 0.0),
        "active_light_fov": float(np.deg2rad(102.0)),
        "pattern_design": PatternDesign(width=1696, height=954, dot_pitch_px=14.4, dot_sigma_px=1.6, seed=2),
    }


_MODELS = {"D415": _d415, "D435": _d435}


# What SAPIEN's StereoDepthSensorConfig calls the engine's parameters, and where its defaults are others.
SAPIEN_NAMES = {
    "max_disparity": "max_disp",
    "p1": "p1_penalty",
    "p2": "p2_penalty",
    "median_size": "median_filter_size",
    "min_depth_m": "min_depth",
    "max_depth_m": "max_depth",
}
SAPIEN_DEFAULTS = {"min_depth_m": 0.2, "depth_dilation": True}


def sapien_name(name: str) -> str:
    """A parameter's name in a sensor's configuration."""
    return SAPIEN_NAMES.get(name, name)


class StereoDepthSensorConfig(MatcherFields):
    """Everything about a sensor; change any field before making the sensor. Raises ValueError for an unknown model,
    AttributeError for a field that there is not."""

    SUPPORTED_MODELS = tuple(_MODELS)
    _FIELDS: tuple[str, ...] = ()  # all names, once a first one has been made
    max_disp: int
    p1_penalty: int
    p2_penalty: int
    median_filter_size: int
    min_depth: float
    max_depth: float

    def __init__(self, model: str = "D435") -> None:
        if str(model).upper() not in _MODELS:
            raise ValueError(f"unknown sensor '{model}' (known: {', '.join(_MODELS)})")
        self.model = str(model).upper()
        preset = _MODELS[self.model]()

        # Cameras. Resolutions are (width, height); poses are those of the IR cameras and the projector in the RGB
        # camera's body frame (x forward, y left, z up).
        self.rgb_resolution = preset["rgb_resolution"]
        self.ir_resolution = preset["ir_resolution"]
        self.rgb_intrinsic = preset["rgb_intrinsic"]
        self.ir_intrinsic = preset["ir_intrinsic"]
        self.trans_pose_l = preset["trans_pose_l"]
        self.trans_pose_r = preset["trans_pose_r"]
        # Lenses, of Brown and Conrady as in OpenCV: k1, k2, p1, p2, k3; both IR cameras have the same one. rectified:
        # the infrared pair is matched as it comes, its rows aligned; a pair with a distorting lens is rectified first
        # all the same.
        self.ir_distortion = (0.0,) * 5
        # Of the right IR camera, where it is not as the left one; None = it is.
        self.ir_intrinsic_right = None
        self.ir_distortion_right = None
        self.rgb_distortion = (0.0,) * 5
        self.rectified = True

        # Projector. active_light_fov: the pattern image's horizontal angle, radians. light_pattern: "generated" from
        # pattern_design, an 8-bit gray array, the path of an image, or None for no projector.
        self.pose_rgb_irproj = preset["pose_rgb_irproj"]
        self.active_light_fov = preset["active_light_fov"]
        self.light_pattern = "generated"
        self.pattern_intrinsic = None  # 3x3 of the pattern image in place of active_light_fov
        self.pattern_design = preset["pattern_design"]
        # In place of light_pattern: [n, 3] u, v and power of dots, in pixels of pattern_design's image and with its
        # dot_sigma_px. A dot's power is the pattern's integral over it, in pixels squared. light_pattern_scale
        # magnifies the pattern about its middle.
        self.light_dots = None
        self.light_pattern_scale = 1.0
        self.projector_intensity = 3.0  # W/sr where the pattern is 1

        # Exposure and infrared light. ir_camera_exposure in seconds; ir_responsivity_dn in counts per W s / (sr m^2).
        self.ir_camera_exposure = 0.01
        self.ir_responsivity_dn = 40000.0
        self.ir_light_dim_factor = 0.05  # what a visible light gives in the infrared, where it does not say
        self.ir_ambient_strength = 0.002  # weak ambient infrared radiance, W/(sr m^2)
        self.rgb_exposure = None  # colour value per radiance; None = the median lit pixel at a quarter of white

        # Shutters, which what moves is seen through (the sensor by set_velocity(), instances and lights by
        # kuafu.Scene). The IR cameras' is open for ir_camera_exposure, the RGB camera's for rgb_exposure_s, seconds,
        # each centred on the same instant. A line time is how many seconds later each line is exposed than the one
        # before; 0 = a global shutter. A readout is the way the lines go: 'rows_down', 'rows_up', 'columns_right' or
        # 'columns_left'.
        self.rgb_exposure_s = 0.0
        self.ir_line_time_s = 0.0
        self.rgb_line_time_s = 0.0
        self.ir_readout = "rows_down"
        self.rgb_readout = "rows_down"

        self.ir_black_level_dn = 5.0  # counts in the dark: the least one finds in pictures of real devices

        # Noise: 1 is SAPIEN's level (a gamma factor of 2.7 % and 0.25 counts), 0 for ir_speckle_noise switches both
        # off.
        self.ir_noise_seed = 0
        self.ir_speckle_noise = 1.0
        self.ir_thermal_noise = 1.0
        # Of which light the speckle is, that of ir_signal too: False = of all, as SAPIEN and the paper have it; True =
        # of the projector's alone, which is coherent (two more images are rendered and copied to the engine).
        self.ir_speckle_of_laser = False
        # Instead of that noise: 'd435', 'paper-d415' or another of simsense.signal_preset, or a dict of
        # simsense_signal's parameters whose input is in counts; exposure, responsivity and black level above come on
        # top.
        self.ir_signal = None

        # Matching and depth: every parameter of simsense_parameters that is not the sensor's own business
        # (capi/tables/reference.md), those that SAPIEN has under SAPIEN's names. depth_maps: what compute_depth() gives
        # besides, out of 'confidence', 'reason', 'points', 'rectified_left' and 'rectified_right'; get_depth_map()
        # returns it.
        for p in MATCHER:
            setattr(self, sapien_name(p.name), SAPIEN_DEFAULTS.get(p.name, p.default))
        self.depth_maps: tuple[str, ...] = ()
        # Where the depth engine works ('auto', 'cpu', 'vulkan'), whether it takes the least memory instead of the least
        # time, and which faults of the published SimSense it keeps, out of simsense.FAULTS.
        self.back_end = "auto"
        self.low_memory = False
        self.faults: tuple[str, ...] = ()

        # Optics of the cameras: a dict of kuafu.Film's fields (vignetting_exponent, psf_sigma_px, ...); None is
        # perfect.
        self.ir_film = None
        self.rgb_film = None

        # Rendering. denoiser: 'none', 'atrous', or 'oidn' where Open Image Denoise is found; it never touches the dots'
        # own light.
        self.denoiser = "none"
        self.samples_per_pixel = 16
        self.max_bounces = 8
        self.render_seed = 0

    def __setattr__(self, name: str, value: Any) -> None:
        if self._FIELDS and name not in self._FIELDS:
            close = [SAPIEN_NAMES[name]] if name in SAPIEN_NAMES else get_close_matches(name, self._FIELDS, 1)
            hint = f"; did you mean '{close[0]}'?" if close else ""
            raise AttributeError(f"a sensor's configuration has no field '{name}'{hint}")
        object.__setattr__(self, name, value)

    @classmethod
    def from_model(cls, model: SensorModel | str | Path, base: str = "D435") -> StereoDepthSensorConfig:
        """The sensor that a model describes: a sensor_model.SensorModel or the path of a model.json. What it does not
        say is the preset's. Give the model to the sensor, too: StereoDepthSensor(config, scene, model=model)."""
        from activestereo.sensor_model import SensorModel, read_model
        from activestereo.sensor_model.configure import configure

        config = cls(base)
        configure(config, model if isinstance(model, SensorModel) else read_model(model))
        return config

    @property
    def focal_baseline_px_m(self) -> float:
        """f * B of the IR pair: depth = this / disparity."""
        baseline_m = np.linalg.norm(self.trans_pose_r.p - self.trans_pose_l.p)
        return float(self.ir_intrinsic[0, 0] * baseline_m)

    def ir_eye(self, is_right: bool) -> tuple[np.ndarray, Sequence[float]]:
        """(K, distortion) of an infrared camera."""
        if not is_right:
            return self.ir_intrinsic, self.ir_distortion
        k, lens = self.ir_intrinsic_right, self.ir_distortion_right
        return self.ir_intrinsic if k is None else k, self.ir_distortion if lens is None else lens

    def scaled(self, factor: float) -> StereoDepthSensorConfig:
        """A copy with all images and the disparity range `factor` times as large; fields of view, readout times,
        projector and depths are the same."""
        if not 0.0 < factor <= 100.0:
            raise ValueError(f"a sensor is scaled by a factor above 0 and up to 100, not {factor}")
        out = deepcopy(self)
        out.max_disp = max(32, round(self.max_disp * factor))
        for camera in ("rgb", "ir"):
            old = np.array(getattr(self, f"{camera}_resolution"))
            new = np.maximum(np.rint(old * factor).astype(int), 1)
            ratio = np.array([new[0] / old[0], new[1] / old[1], 1.0])
            setattr(out, f"{camera}_resolution", (int(new[0]), int(new[1])))
            for name in [f"{camera}_intrinsic"] + (
                ["ir_intrinsic_right"] if camera == "ir" and self.ir_intrinsic_right is not None else []
            ):
                k = getattr(self, name).copy()
                k[:2, 2] += 0.5  # pixel centres are at integers: the image's corner is at -0.5
                k = k * ratio[:, None]
                k[:2, 2] -= 0.5
                setattr(out, name, k)
            lines = 0 if "columns" in getattr(self, f"{camera}_readout") else 1
            setattr(out, f"{camera}_line_time_s", getattr(self, f"{camera}_line_time_s") / ratio[lines])
        return out

    def pattern(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The projector's image as uint8 [height, width] and its 3x3 K, or None where there is no projector."""
        if self.light_pattern is None:
            return None
        if isinstance(self.light_pattern, str) and self.light_pattern == "generated":
            image = make_pattern(self.pattern_design)
        elif isinstance(self.light_pattern, np.ndarray):
            image = self.light_pattern
        else:
            from activestereo.images import read_gray

            image = read_gray(self.light_pattern, key="light_pattern")
        height, width = image.shape
        return image, self.pattern_k(width, height)

    def pattern_k(self, width: int, height: int) -> np.ndarray:
        """The projector's 3x3 K for a pattern image of this size."""
        if self.pattern_intrinsic is not None:
            return np.array(self.pattern_intrinsic, dtype=np.float64)
        focal = 0.5 * width / np.tan(0.5 * self.active_light_fov)
        return _k(focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))


StereoDepthSensorConfig._FIELDS = tuple(vars(StereoDepthSensorConfig()))
