# SPDX-License-Identifier: Apache-2.0
"""A wrong argument of the depth engine is one line that names it and what it must be, without names out of C."""

import numpy as np
import pytest

import simsense
from activestereo.common.pose import rigid_motion

K = [[400.0, 0.0, 160.0], [0.0, 400.0, 120.0], [0.0, 0.0, 1.0]]
IMAGE = np.zeros((240, 320), np.uint8)


def pose(x=-0.05):
    return rigid_motion((x, 0, 0))


def camera(k=K):
    return simsense.Camera(320, 240, k)


def make(k=K, x=-0.05, **settings):
    return simsense.Engine(simsense.Device("host"), camera(k), camera(k), pose(x), **{"rectified": True, **settings})


def k_of(fx, fy, cx=160.0):
    return [[fx, 0, cx], [0, fy, 120], [0, 0, 1]]


@pytest.mark.parametrize(
    ("call", "words"),
    {
        "no baseline": (lambda: make(x=0.0), ("x translation 0 m", "baseline")),
        "vast baseline": (lambda: make(x=-1e9), ("1e+09 m", "metres")),
        "vast baseline, unrectified": (lambda: make(x=-1e9, rectified=False), ("1e+09 m", "metres")),
        "tiny baseline": (lambda: make(x=-1e-9), ("1e-09 m", "metres")),
        "negative focal length": (lambda: make(k_of(-400, 400)), ("-400", "> 0")),
        "focal length in metres": (lambda: make(k_of(2e-3, 2e-3)), ("0.002", "pixels")),
        "vast focal length": (lambda: make(k_of(1e12, 1e12)), ("1e+12", "pixels")),
        "squeezed pixels": (lambda: make(k_of(400, 4)), ("fx = 400, fy = 4", "factor")),
        "principal point": (lambda: make(k_of(400, 400, 1e9)), ("principal point 1e+09",)),
        "no K": (lambda: simsense.Camera(320, 240, None), ("k is missing",)),
        "width as text": (lambda: simsense.Camera("a", 240, K), ("width", "'a'")),
        "negative width": (lambda: simsense.Camera(-1, 240, K), ("width", "-1")),
        "no camera": (
            lambda: simsense.Engine(simsense.Device("host"), None, None, pose()),
            ("left", "simsense.Camera", "None"),
        ),
        "no device": (lambda: simsense.Engine(None, camera(), camera(), pose()), ("device", "simsense.Device")),
        "no pose": (
            lambda: simsense.Engine(simsense.Device("host"), camera(), camera(), None),
            ("left_to_right is missing",),
        ),
        "batch": (lambda: make(batch_count=None), ("batch_count", "None")),
        "rgb": (lambda: make(rgb=3), ("rgb", "simsense.Camera")),
        "parameter": (lambda: make(p1=None), ("p1", "None")),
        "census": (lambda: make(census_kind=7), ("center_symmetric (0)", "plain (1)")),
        "subpixel": (lambda: make(subpixel=9), ("equiangular_summed (3)",)),
        "subpixel by name": (lambda: make(subpixel="best"), ("'best'", "parabola")),
        "holes": (lambda: make(hole_filling=9), ("background (2)",)),
        "fault": (lambda: make(faults=("x",)), ("unknown fault 'x'", "remap_nearest")),
        "faults": (lambda: make(faults=None), ("faults", "None")),
        "a fault that is no name": (lambda: make(faults=[3]), ("faults", "[3]")),
        "outputs": (lambda: make().compute(IMAGE, IMAGE, None), ("outputs", "None")),
        "an output that is no name": (lambda: make().compute(IMAGE, IMAGE, (3,)), ("outputs", "(3,)")),
        "one name": (lambda: make().compute(IMAGE, IMAGE, "depth"), ("sequence", "'depth'")),
        "no output": (lambda: make().compute(IMAGE, IMAGE, ()), ("no output",)),
        "image": (lambda: make().compute(None, None), ("left", "array")),
        "signal": (lambda: make().set_signal(None, {}), ("left", "dict", "None")),
        "preset": (lambda: simsense.signal_preset(None), ("name", "None")),
    }.values(),
)
def test_engine_says_what_is_wrong(call, words):
    with pytest.raises(simsense.ArgumentError) as caught:
        call()
    text = str(caught.value)
    assert "\n" not in text and "SIMSENSE_" not in text and "incompatible" not in text
    for word in words:
        assert word in text, text


def test_times_of_a_running_call_are_refused():
    engine = make()
    engine.compute(IMAGE, IMAGE, ("disparity",))
    assert "census" in engine.stage_times

    def ask(fraction):
        engine.stage_times

    with pytest.raises(simsense.Error, match="inside another call"):
        engine.compute(IMAGE, IMAGE, ("disparity",), progress=ask)


def test_choices_may_be_named():
    engine = make(subpixel="parabola", census_kind="plain")
    assert (engine.parameters["subpixel"], engine.parameters["census_kind"]) == (1, 1)
    engine.set_parameters(hole_filling="background", subpixel=2)
    assert (engine.parameters["hole_filling"], engine.parameters["subpixel"]) == (2, 2)


@pytest.mark.parametrize(
    "setting",
    [{"min_depth": None}, {"max_depth": "a"}, {"speckle_shape": None}, {"speckle_shape": 1, "speckle_scale": None}],
)
def test_sensor_names_the_setting(setting):
    with pytest.raises(simsense.SettingError, match=list(setting)[-1]):
        simsense.DepthSensor((320, 240), K, K, pose(), **setting)


def test_stereo_sgm_names_the_setting():
    for setting in ({"minDisparity": None}, {"numDisparities": 16.5}, {"P1": "8"}, {"mode": None}):
        with pytest.raises(ValueError, match=f"{next(iter(setting))} must be an integer"):
            simsense.StereoSGM(**setting)
