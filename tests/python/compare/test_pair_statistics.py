# SPDX-License-Identifier: Apache-2.0
"""Figures of one pair and of two: noise, dots, and what differs between real and simulated."""

import json

import numpy as np
import pytest
from activestereo.capture.images import write_gray
from activestereo.cli import main
from activestereo.compare.pair_findings import pair_findings, pair_statistics
from scipy.ndimage import gaussian_filter, shift

_DISPARITY_PX = 20
_BLACK_DN = 16.0


def drawn_pair(noise_dn, dot_dn=40.0, pitch_px=9, height=240, width=320, seed=0):
    """A flat view at 30 DN above black with dots of sigma 1 px at whole pixels; a corner is unlit."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:height, 0:width]
    place = [(y, x) for y in range(4, height, pitch_px) for x in range(4, width, pitch_px) if rng.random() < 0.5]
    light = np.zeros((height, width))
    for y, x in place:
        around = np.s_[max(y - 4, 0) : y + 5, max(x - 4, 0) : x + 5]
        light[around] += dot_dn * np.exp(-0.5 * ((v[around] - y) ** 2 + (u[around] - x) ** 2))
    light += 14.0
    light[:30] = 0.0
    right = shift(light, (0, -_DISPARITY_PX), order=0, mode="nearest")
    images = (
        np.clip(np.rint(image + _BLACK_DN + rng.normal(0.0, noise_dn, image.shape)), 0, 255).astype(np.uint8)
        for image in (light, right)
    )
    return *images, np.full((height, width), float(_DISPARITY_PX)), 1e3 * len(place) / light.size


def found(noise_dn, **how):
    left, right, disparity, _ = drawn_pair(noise_dn, **how)
    return {f.name: f for f in pair_statistics(left, right, disparity, 255.0)}


@pytest.mark.parametrize("noise_dn", [0.8, 1.6])
def test_the_noise_that_was_drawn_is_found(noise_dn):
    # Disparities are whole pixels here, so that the warp keeps all of the noise, where on average it keeps 0.75.
    expected = np.sqrt(2.0 / 1.75 * (noise_dn**2 + 1.0 / 12.0))
    noise = found(noise_dn)["noise_20_40_dn"]
    assert noise.value == pytest.approx(expected, rel=0.1)
    assert noise.low < noise.value < noise.high


def test_dots_are_counted_and_measured():
    left, right, disparity, per_1000 = drawn_pair(0.8)
    values = {f.name: f.value for f in pair_statistics(left, right, disparity, 255.0)}
    assert values["dots_per_1000_px"] == pytest.approx(per_1000, rel=0.15)
    assert 30.0 < values["dot_peak_dn"] < 42.0
    assert values["black_dn"] == pytest.approx(_BLACK_DN, abs=3.0)


def test_more_noise_leaves_more_residual():
    assert found(3.0)["residual_share"].value > 2.0 * found(0.8)["residual_share"].value


def test_two_pairs_stand_side_by_side(tmp_path, capsys):
    for name, noise in (("real", 1.6), ("simulated", 0.8)):
        (tmp_path / name).mkdir()
        left, right, _, _ = drawn_pair(noise)
        write_gray(tmp_path / name / "left.png", left)
        write_gray(tmp_path / name / "right.png", right)
    real, out = tmp_path / "real", tmp_path / "out"
    arguments = [
        "pair",
        str(real / "left.png"),
        str(real / "right.png"),
        "--k",
        "300,300,160,120",
        "--baseline",
        "0.05",
        "--out",
        str(out),
    ]
    assert main([*arguments, "--against", str(tmp_path / "nowhere")]) == 2
    assert "nowhere: holds neither" in capsys.readouterr().err
    assert main([*arguments, "--against", str(tmp_path / "simulated")]) == 0
    assert (out / "against.png").stat().st_size > 10_000
    report = json.loads((out / "pair.json").read_text())
    noise = {
        key: next(f["value"] for f in report[key] if f["name"] == "noise_20_40_dn") for key in ("statistics", "against")
    }
    assert noise["statistics"] > 1.5 * noise["against"]
    assert "against" in capsys.readouterr().out


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


def test_the_command_writes_its_findings(pair, tmp_path, capsys):
    for name, image in zip(("left", "right"), pair[:2], strict=True):
        write_gray(tmp_path / f"{name}.png", image.astype(np.uint8))
    arguments = [
        "pair",
        str(tmp_path / "left.png"),
        str(tmp_path / "right.png"),
        "--k",
        "200,200,192,120",
        "--baseline",
        "0.05",
    ]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    found = {f["name"]: f for f in json.loads((tmp_path / "out" / "pair.json").read_text())["findings"]}
    assert found["gain_ratio"]["value"] == pytest.approx(GAIN, abs=0.02)
    assert "gain of the right camera" in capsys.readouterr().out
    write_gray(tmp_path / "depth.png", np.zeros((7, 11), np.uint16))
    assert main([*arguments, "--device-depth", str(tmp_path / "depth.png"), "--out", str(tmp_path / "out")]) == 2
    assert "not a whole number of times smaller" in capsys.readouterr().err
