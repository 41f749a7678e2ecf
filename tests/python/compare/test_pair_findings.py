# SPDX-License-Identifier: Apache-2.0
"""Faults of one pair lie in their intervals."""

import json

import numpy as np
import pytest
from activestereo.capture.images import write_gray
from activestereo.cli import main
from activestereo.compare.pair_findings import pair_findings
from scipy.ndimage import gaussian_filter, shift
from command_line import refused

GAIN, OFFSET, ROWS_PX, SCALE, DISPARITY = 1.08, -3.0, 0.15, 0.012, 9.0


@pytest.fixture(scope="module")
def pair():
    """(left, right, disparity, device's disparity): a rough texture; the right camera is shifted, brighter and
    lower."""
    rng = np.random.default_rng(4)
    texture = gaussian_filter(rng.standard_normal((240, 384)), 1.2)
    scene = 90 + 60 * texture / texture.std()
    lower = shift(scene, (ROWS_PX, -DISPARITY), order=3, mode="nearest")
    noise = lambda: rng.standard_normal(scene.shape)  # noqa: E731
    left, right = (np.clip(np.rint(image), 0, 255) for image in (scene + noise(), OFFSET + GAIN * lower + noise()))
    device = np.where(rng.random(scene.shape) < 0.9, np.linspace(6, 12, 384)[None] * np.ones((240, 1)), 0.0)
    own = np.where(device > 0, device * (1 + SCALE) + 0.05 * noise(), 0.0)
    return left, right, np.full(scene.shape, DISPARITY), own, device


def test_every_made_fault_lies_in_its_interval(pair):
    left, right, disparity, _, _ = pair
    found = {f.name: f for f in pair_findings(left, right, disparity, 255)}
    for name, truth, room in (("gain_ratio", GAIN, 0.01), ("offset_dn", OFFSET, 1.0), ("row_offset_px", ROWS_PX, 0.02)):
        f = found[name]
        assert f.value == pytest.approx(truth, abs=room) and f.stands_out, f
        assert f.low - room < truth < f.high + room
    assert not found["row_offset_across_px"].stands_out
    assert found["saturated_right"].value > found["saturated_left"].value > 0


def test_scale_and_offset_of_disparity_are_told_apart_over_a_range(pair):
    left, right, _, own, device = pair
    found = {f.name: f for f in pair_findings(left, right, own, 255, device)}
    assert found["focal_baseline_error"].value == pytest.approx(SCALE, abs=0.001)
    both = found["focal_baseline_error_beside_offset"]
    assert both.low < SCALE < both.high
    assert abs(found["offset_beside_scale_px"].value) < 0.02


def test_an_unmatched_pair_is_refused(pair):
    with pytest.raises(ValueError, match="0 pixels of the pair are matched"):
        pair_findings(pair[0], pair[1], np.zeros(pair[0].shape), 255)
    with pytest.raises(ValueError, match="only 0 pixels have a disparity of both; 500 are needed"):
        pair_findings(*pair[:3], 255, np.zeros(pair[0].shape))


@pytest.mark.filterwarnings("error")
def test_a_small_pair_has_findings(pair):
    assert pair_findings(*(image[:48, :48] for image in pair[:3]), 255)


def test_the_command_writes_its_findings(pair, tmp_path, capsys):
    for name, image in zip(("left", "right"), pair[:2], strict=True):
        write_gray(tmp_path / f"{name}.png", image.astype(np.uint8))
    images = [str(tmp_path / f"{name}.png") for name in ("left", "right")]
    arguments = ["pair", *images, "--k", "200,200,192,120", "--baseline", "0.05", "--out", str(tmp_path / "out")]
    assert main(arguments) == 0
    found = {f["name"]: f for f in json.loads((tmp_path / "out" / "pair.json").read_text())["findings"]}
    assert found["gain_ratio"]["value"] == pytest.approx(GAIN, abs=0.02)
    assert "gain of the right camera" in capsys.readouterr().out
    write_gray(tmp_path / "depth.png", np.zeros((7, 11), np.uint16))
    device_depth = [*arguments, "--device-depth"]
    assert "not a whole number of times smaller" in refused([*device_depth, tmp_path / "depth.png"], capsys)
    assert "left.png has 8 bits" in refused([*device_depth, images[0]], capsys)
    assert "--depth-scale is the unit of --device-depth" in refused([*arguments, "--depth-scale", "0.001"], capsys)
    with pytest.raises(SystemExit):
        main([*arguments, "--depth-scale", "0"])
    assert "a number above 0" in capsys.readouterr().err
