# SPDX-License-Identifier: Apache-2.0
"""A depth error's parts add up, and each is found where it alone was made."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.image_errors import Judged, image_errors
from activestereo.compare.render import BaseRenders
from activestereo.diagnose.depth_engine import Depth
from activestereo.diagnose.depth_split import OWN, PARTS, depth_split, split_of
from activestereo.effects import Model, builtin
from activestereo.report.diagnosis import split_sentences
from lab_worlds import WorldRenderer, with_device_depth
from virtual_sensor.world import make_world

FOCAL_BASELINE = 20.0


def frame(seed=0, warming_k=0.0, **made):
    """Errors of one frame: noise of our matcher, of which the device has half and its own, and what is made beside."""
    rng = np.random.default_rng(seed)
    n = 20000
    distance_m = rng.uniform(0.5, 2.0, n)
    disparity = FOCAL_BASELINE / distance_m
    shared = 0.1 * rng.standard_normal(n)
    zero = np.zeros(n)
    images = {"by_effects": zero, "by_filters": zero} | {k: f(disparity) for k, f in made.items() if k != "own"}
    own = 0.02 * rng.standard_normal(n) + (made["own"](disparity) if "own" in made else 0.0)
    measured = shared + images["by_effects"]
    return dict(
        device=measured + images["by_filters"] + own,
        measured=measured,
        **images,
        beside_model=own,
        disparity=disparity,
        distance_m=distance_m,
        metres_per_px=-(distance_m**2) / FOCAL_BASELINE,
        material=(np.arange(n) >= n // 4).astype(int),
        warming_k=np.full(n, warming_k),
    )


def largest(frames):
    told = split_of(frames, frames, str)["after"]
    assert sum(told["parts"][name]["share_px"] for name in PARTS) == pytest.approx(1.0)
    assert sum(told["parts"][name]["share_m"] for name in PARTS) == pytest.approx(1.0)
    squares = sum(np.sign(p["rms_m"]) * p["rms_m"] ** 2 for p in (told["parts"][name] for name in PARTS))
    assert squares == pytest.approx(told["rms_m"] ** 2)
    own = told["parts"]["sensor's own"]["share_px"]
    assert own == pytest.approx(sum(told["parts"][name]["share_px"] for name in OWN))
    return max(PARTS, key=lambda name: told["parts"][name]["share_px"]), told


def test_the_largest_part_is_the_one_that_was_made():
    assert largest([frame()])[0] == "any matcher"
    assert largest([frame(by_effects=lambda d: 0.3 * np.sin(d))])[0] == "image effects"
    assert largest([frame(by_filters=lambda d: 0.3 * np.cos(7 * d))])[0] == "filters"
    assert largest([frame(own=lambda d: 0.3 * np.cos(7 * d))])[0] == "other matcher"
    name, told = largest([frame(own=lambda d: 0.012 * d + 0.2)])
    assert name == "calibration"
    made = np.sqrt(np.mean((0.012 * frame()["disparity"] + 0.2) ** 2))
    assert told["parts"][name]["rms_px"] == pytest.approx(made, rel=0.02)
    cold, warm = frame(), frame(1, 20.0, own=lambda d: 0.5 + 0.0 * d)
    assert largest([frame(own=lambda d: -0.5 + 0.0 * d), warm | {"warming_k": np.zeros(20000)}])[0] == "other matcher"
    assert largest([frame(own=lambda d: -0.5 + 0.0 * d), warm])[0] == "temperature"
    assert largest([cold, frame(1, 20.0)])[1]["parts"]["temperature"]["share_px"] < 0.01


def test_noise_that_the_device_did_not_have_counts_nothing():
    """Half of what the effects are said to change is noise of our own draws."""
    noisy = frame(by_effects=lambda d: 0.3 * np.sin(d))
    rng = np.random.default_rng(5)
    drawn = noisy | {"by_effects": noisy["by_effects"] + 0.3 * rng.standard_normal(20000)}
    clean, drawn = (largest([f])[1]["parts"]["image effects"] for f in (noisy, drawn))
    assert drawn["rms_px"] == pytest.approx(clean["rms_px"], rel=0.03)


def test_distances_and_materials_hold_all_pixels():
    told = split_of([frame()], [frame(by_effects=lambda d: 0.1 * np.sin(d))], {0: "wood", 1: "steel"}.get)
    assert [m["material"] for m in told["by_material"]] == ["steel", "wood"]
    assert sum(m["pixels"] for m in told["by_material"]) == told["pixels"] == 20000
    assert [d["pixels"] for d in told["by_distance"]] == pytest.approx([5000] * 4, abs=2)
    near, *_, far = told["by_distance"]
    assert far["after"]["rms_m"] > 3.0 * near["after"]["rms_m"] and near["from_m"] < near["to_m"] < far["from_m"]
    before, after = (told[when]["parts"]["image effects"]["share_px"] for when in ("before", "after"))
    assert before == 0.0 < after


def test_sentences_tell_parts_that_add_up():
    """A part of opposite sign is taken off, and roundings leave the sum whole."""
    told = split_of([frame()], [frame(by_effects=lambda d: 0.1 * np.sin(d), own=lambda d: 0.003 * d)], str)
    told |= {"images_agree": False, "filters": []}
    size, parts, *rest = split_sentences(told)
    whole = told["after"]
    assert f"{1e3 * whole['rms_m']:.2f} mm ({whole['rms_px']:.3f} px)" in size and "20000 pixels" in size
    assert sum(int(share) for share in re.findall(r"(\d+) % comes", parts)) == 100
    assert "still lack something" in rest[0] and rest[1].count(" mm at ") == 4 and split_sentences(None) == []
    shares = {"any matcher": 1.106, "calibration": 0.006, "other matcher": -0.112}
    for name, part in whole["parts"].items():
        part["share_m"] = shares.get(name, 0.0)
    kept, taken = split_sentences(told)[1].split(", less ")
    percents = [sum(int(share) for share in re.findall(r"(\d+) %", words)) for words in (kept, taken)]
    assert percents == [111, 11]


@pytest.mark.parametrize("stretch", [1.0, 1.03])
def test_a_device_that_stretches_depth_is_told_as_out_of_calibration(tmp_path, stretch):
    world = make_world(tmp_path / "world", size=(160, 90), grid=1)
    capture = read_capture(with_device_depth(world, tmp_path / "capture", ids=(0, 2), stretch=stretch))
    renders = BaseRenders(WorldRenderer(world, grid=1), 2, 1, 0, LayerCache(tmp_path / "cache"))
    halves = renders.halves(capture, capture.frames)
    faded = Model().with_effect(builtin()["vignetting"], exponent=1.0)
    done: list[float] = []

    def known(capture, frames, progress):
        progress(1.0)
        return halves

    renders = SimpleNamespace(halves=known, seed=0, cache=renders.cache)
    plain, found = image_errors(capture, [Judged(Model()), Judged(faded)], renders, done.append)
    poses = len({frame.camera_to_world.tobytes() for frame in capture.frames})
    assert done == pytest.approx([(i + 1) / poses for i in range(poses)])  # no engine renders: views are all the work
    told = depth_split(capture, plain, plain, found, Depth((), True), str, 0)
    share = {name: part["share_px"] for name, part in told["after"]["parts"].items()}
    assert told["images_agree"] and not told["filters"] and told["pixels"] > 10000
    assert abs(share["image effects"]) < 0.1 and abs(share["other matcher"]) < 0.02
    assert 0.3 < share["calibration"] < 0.6 if stretch > 1.0 else abs(share["calibration"]) < 0.02
    assert told["before"]["parts"]["image effects"]["share_px"] == 0.0
    assert told["after"]["parts"]["calibration"] == pytest.approx(told["before"]["parts"]["calibration"])
