# SPDX-License-Identifier: Apache-2.0
"""Effects of cameras whose pose or lens differs from the calibration, and of those that move while they expose."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, rotation
from activestereo.effects.core.light import Light
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.view import View


@engine_effect(
    stage=Stage.CAMERA, family="camera geometry", moves=("right.camera.camera_to_world",),
    finding="The baseline is another one than calibrated",
    source="scale errors of f x baseline of 0.6 % (D435) and 1.2 % (D415) found in public data",
    parameters=[Parameter("offset_m", "m", low=-0.005, high=0.005, typical=0.0003)],
)  # fmt: skip
def baseline_drift(inputs: EngineInputs, offset_m: float) -> None:
    """The right camera stands offset_m further right. Every disparity grows in proportion to itself."""
    inputs.right.move(offset_m)


@engine_effect(
    stage=Stage.CAMERA, family="camera geometry", moves=("right.camera.camera_to_world",),
    finding="The right camera is pitched against its calibration",
    source="vertical disparity 0.02-0.3 px on real D4xx pairs",
    parameters=[Parameter("angle_rad", "rad", low=-0.02, high=0.02, typical=0.0005)],
)  # fmt: skip
def stereo_pitch(inputs: EngineInputs, angle_rad: float) -> None:
    """The right camera is turned about its x axis. Rows of the pair no longer meet."""
    inputs.right.turn((1.0, 0.0, 0.0), angle_rad)


@engine_effect(
    stage=Stage.CAMERA, family="camera geometry", moves=("right.camera.camera_to_world",),
    finding="The right camera is rolled against its calibration",
    source="vertical disparity that changes over the image width on real D4xx pairs",
    parameters=[Parameter("angle_rad", "rad", low=-0.05, high=0.05, typical=0.001)],
)  # fmt: skip
def stereo_roll(inputs: EngineInputs, angle_rad: float) -> None:
    """The right camera is turned about its optical axis."""
    inputs.right.turn((0.0, 0.0, 1.0), angle_rad)


@engine_effect(
    stage=Stage.CAMERA, family="camera geometry", moves=("camera.k",),
    finding="The cameras' geometry drifts with temperature",
    source="D415/D455 at 1.7 m: 5 mm between 28 and 35 C (librealsense issue 8434)",
    parameters=[
        Parameter("cx_px_per_k", "px/K", low=-0.1, high=0.1, typical=0.005),
        Parameter("focal_per_k", "1/K", low=-1e-3, high=1e-3, typical=2e-5),
    ],
)  # fmt: skip
def thermal_drift(inputs: EngineInputs, cx_px_per_k: float, focal_per_k: float) -> None:
    """The right image shifts with every kelvin above 25 C. Both images grow about their principal points."""
    inputs.right.shift_image(cx_px_per_k * inputs.warming_k, 0.0)
    for side in inputs.sides:
        side.scale_focal(1.0 + focal_per_k * inputs.warming_k)


@engine_effect(
    stage=Stage.CAMERA, family="camera geometry", moves=("right.camera.k",),
    finding="The right image is shifted against its calibration",
    source="device reports of 0.05-1 px after thermal or mechanical stress (librealsense issues 8230, 9561)",
    parameters=[
        Parameter("cx_px", "px", low=-5.0, high=5.0, typical=0.2),
        Parameter("cy_px", "px", low=-5.0, high=5.0, typical=0.1),
    ],
)  # fmt: skip
def principal_point_offset(inputs: EngineInputs, cx_px: float, cy_px: float) -> None:
    """The right image is shifted. The disparity error is constant; the depth error grows with distance squared."""
    inputs.right.shift_image(cx_px, cy_px)


@effect(
    stage=Stage.CAMERA, family="camera geometry",
    finding="The imagers stand askew behind their lenses",
    source="Scheimpflug model: Louhichi et al. 2007, Self-calibration of Scheimpflug cameras; OpenCV's tau_x, tau_y; "
           "camera modules are assembled to 0.1 to 0.5 degrees",
    image_only="kuafu's imagers stand square behind their lenses",
    parameters=[
        Parameter("tau_x_rad", "rad", low=-0.1, high=0.1, typical=0.005),
        Parameter("tau_y_rad", "rad", low=-0.1, high=0.1, typical=0.005),
    ],
)  # fmt: skip
def imager_tilt(light: Light, view: View, tau_x_rad: float, tau_y_rad: float) -> Light:
    """The imager is turned about its x axis, then about its y axis, around the principal point. The image of a plane
    changes by a homography, which keeps straight lines straight."""
    if tau_x_rad == 0.0 and tau_y_rad == 0.0:
        return light
    turn = rotation((0.0, 1.0, 0.0), tau_y_rad) @ rotation((1.0, 0.0, 0.0), tau_x_rad)
    x, y = view.rays()
    # `place` is the point (x, y) of the tilted imager behind the lens, in focal lengths. Its ray meets the plane z = 1
    # at place / z.
    place = turn @ np.stack([x.ravel(), y.ravel(), np.zeros(x.size)]) + np.array([[0.0], [0.0], [1.0]])
    return light.warped(*view.to_pixels(*(place[:2] / place[2]).reshape(2, *x.shape)))


@engine_effect(
    stage=Stage.CAMERA, family="camera geometry", moves=("camera.distortion",),
    finding="The lenses distort more or less than calibrated",
    source="Brown 1966, Decentering distortion of lenses; OpenCV's k1, k2",
    parameters=[
        Parameter("k1", "1", low=-0.3, high=0.3, typical=0.01),
        Parameter("k2", "1", low=-0.1, high=0.1, typical=0.005),
    ],
)  # fmt: skip
def radial_distortion(inputs: EngineInputs, k1: float, k2: float) -> None:
    """Straight lines bend in both cameras. The lens draws radius r at r (1 + k1 r^2 + k2 r^4), in focal lengths."""
    for side in inputs.sides:
        side.add_distortion(k1, k2)


@engine_effect(
    stage=Stage.CAMERA, family="camera geometry", moves=("camera.distortion",),
    finding="The lenses' elements are off their axis",
    source="Brown 1966, Decentering distortion of lenses; OpenCV's p1, p2; 1e-4 to 1e-3 on calibrated D4xx modules",
    parameters=[
        Parameter("p1", "1", low=-0.02, high=0.02, typical=0.001),
        Parameter("p2", "1", low=-0.02, high=0.02, typical=0.001),
    ],
)  # fmt: skip
def tangential_distortion(inputs: EngineInputs, p1: float, p2: float) -> None:
    """The image point (x, y), in focal lengths, moves by (2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y) in
    both cameras. One side of the image stretches, the other one shrinks."""
    for side in inputs.sides:
        side.add_distortion(p1=p1, p2=p2)


_STEPS = 6  # fixed-point iterations, each of which contracts by 2 |s| r


@effect(
    stage=Stage.CAMERA, family="camera geometry",
    finding="A wedge of glass bends the images",
    source="Weng, Cohen and Herniou 1992, Camera calibration with distortion models, eq. 10; OpenCV's s1, s3",
    image_only="kuafu's lens has radial and tangential terms",
    parameters=[
        Parameter("s1", "1", low=-0.03, high=0.03, typical=0.002),
        Parameter("s3", "1", low=-0.03, high=0.03, typical=0.002),
    ],
)  # fmt: skip
def thin_prism(light: Light, view: View, s1: float, s3: float) -> Light:
    """The image point (x, y), in focal lengths, moves by (s1, s3) r^2 in both cameras."""
    if s1 == 0.0 and s3 == 0.0:
        return light
    drawn_x, drawn_y = view.rays()
    x, y = drawn_x, drawn_y
    for _ in range(_STEPS):
        r2 = x * x + y * y
        x, y = drawn_x - s1 * r2, drawn_y - s3 * r2
    return light.warped(*view.to_pixels(x, y))


@engine_effect(
    stage=Stage.CAMERA, family="motion", moves=("right.delay_s",),
    finding="The right camera exposes at another time than the left one",
    source="stereo pairs without hardware synchronisation: shift = f v dt / z",
    parameters=[Parameter("delay_s", "s", low=-0.02, high=0.02, typical=0.001)],
)  # fmt: skip
def exposure_desync(inputs: EngineInputs, delay_s: float) -> None:
    """The right camera exposes delay_s after the left one. The disparity error follows the rig's velocity."""
    inputs.right.delay_s += delay_s


@engine_effect(
    stage=Stage.CAMERA, family="motion", moves=("camera.exposure_s",),
    finding="Motion blurs the images",
    source="exposure is an integral over time",
    parameters=[Parameter("exposure_fraction", "1", high=2.0, typical=1.0, source="1 = the frame's own exposure time")],
)  # fmt: skip
def motion_blur(inputs: EngineInputs, exposure_fraction: float) -> None:
    """The rig moves while the image is exposed. The image is the mean of the views during the exposure."""
    for side in inputs.sides:
        side.camera.exposure_s = exposure_fraction * inputs.frame.exposure_s


@engine_effect(
    stage=Stage.CAMERA, family="motion", moves=("camera.shutter", "camera.line_time_s", "camera.readout"),
    finding="Rows are exposed one after the other",
    source="Meingast, Geyer and Sastry 2005, Geometric models of rolling-shutter cameras",
    parameters=[Parameter("line_time_s", "s", low=-1e-4, high=1e-4, typical=2e-5, source="10-70 us on common imagers")],
)  # fmt: skip
def rolling_shutter(inputs: EngineInputs, line_time_s: float) -> None:
    """The imager exposes its rows one after the other. The middle row has the frame's time."""
    for side in inputs.sides:
        side.camera.shutter = "rolling"
        side.camera.line_time_s = abs(line_time_s)
        side.camera.readout = "rows_down" if line_time_s > 0 else "rows_up"
