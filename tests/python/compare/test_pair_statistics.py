# SPDX-License-Identifier: Apache-2.0
"""Dots and noise of a pair that was drawn here: the figures are those that it was drawn with."""

import json

import numpy as np
import pytest
from scipy.ndimage import shift

from activestereo.cli import main
from activestereo.capture.images import write_gray
from activestereo.compare.pair_findings import pair_statistics

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
