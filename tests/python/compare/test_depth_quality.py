# SPDX-License-Identifier: Apache-2.0
"""Intel's depth quality metrics on planes whose answers are known."""

import json

import numpy as np
import pytest
from PIL import Image

from activestereo.cli import main
from activestereo.compare.depth_quality import depth_quality, quality_table, region_of

K = np.array([[420.0, 0, 319.5], [0, 420.0, 239.5], [0, 0, 1.0]])
SHAPE = (480, 640)
BASELINE = 0.05
FOCAL_BASELINE = K[0, 0] * BASELINE


def plane(distance_m=1.0, tilt_x=0.0, tilt_y=0.0):
    """Depth of a plane that meets the optical axis at distance_m, turned by slopes dz/dx, dz/dy in space."""
    v, u = np.indices(SHAPE)
    x, y = (u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]
    return distance_m / (1 - tilt_x * x - tilt_y * y)


def test_perfect_plane_has_no_error():
    for depth in (plane(), plane(0.7, 0.4, -0.2)):
        q = depth_quality(depth, K, BASELINE, true_distance_m=depth[239:241, 319:321].mean())
        assert q.fill_rate_percent == 100
        assert q.z_accuracy_percent == pytest.approx(0, abs=1e-4)
        assert q.plane_fit_rms_mm == pytest.approx(0, abs=1e-6)
        assert q.subpixel_rms_px == pytest.approx(0, abs=1e-6)
        assert np.isnan(q.temporal_noise_percent)


@pytest.mark.parametrize("sigma_px", [0.05, 0.2])
@pytest.mark.parametrize("distance_m", [0.5, 1.5])
def test_disparity_noise_comes_back_in_pixels_and_millimetres(sigma_px, distance_m):
    noise = np.random.default_rng(1).normal(0, sigma_px, SHAPE)
    depth = FOCAL_BASELINE / (FOCAL_BASELINE / plane(distance_m) + noise)
    q = depth_quality(depth, K, BASELINE, region=region_of(SHAPE, 0.2))
    assert q.subpixel_rms_px == pytest.approx(
        sigma_px, rel=0.06
    )  # 0.5 % at each end are left out, and the region is a little off the axis
    assert q.plane_fit_rms_mm == pytest.approx(1e3 * sigma_px * distance_m**2 / FOCAL_BASELINE, rel=0.06)
    assert depth_quality(depth, K, BASELINE, distance_m).z_accuracy_percent == pytest.approx(0, abs=0.1)


def test_z_accuracy_is_signed_and_not_fooled_by_tilt():
    for tilt in (0.0, 0.3):
        for error in (-0.02, 0.03):
            depth = plane(1.0 + error, tilt)
            assert depth_quality(depth, K, BASELINE, 1.0).z_accuracy_percent == pytest.approx(100 * error, abs=0.01)


def test_fill_rate_counts_the_region():
    depth = plane()
    depth[:, :320] = 0
    assert depth_quality(depth, K, BASELINE).fill_rate_percent == 50
    assert depth_quality(depth, K, BASELINE, region=(slice(0, 480), slice(400, 500))).fill_rate_percent == 100
    q = depth_quality(np.zeros(SHAPE), K, BASELINE, 1.0)
    assert q.fill_rate_percent == 0 and np.isnan([q.z_accuracy_percent, q.plane_fit_rms_mm, q.subpixel_rms_px]).all()


def test_few_outliers_are_left_out():
    depth = plane()
    random = np.random.default_rng(2)
    rows, columns = random.integers(150, 330, 60), random.integers(200, 440, 60)
    depth[rows, columns] = 1.004  # 0.12 % of the region
    assert depth_quality(depth, K, BASELINE).plane_fit_rms_mm < 0.05


def test_temporal_noise_is_relative_to_the_distance():
    random = np.random.default_rng(3)
    frames = 2.0 * (1 + random.normal(0, 0.004, (40, 120, 160)))
    k = np.diag([100.0, 100.0, 1.0]) + np.array([[0, 0, 79.5], [0, 0, 59.5], [0, 0, 0]])
    assert depth_quality(frames, k, BASELINE).temporal_noise_percent == pytest.approx(0.4, rel=0.03)
    frames[:30, :, ::2] = 0  # seen too seldom to tell
    frames[5:10, :, 1::2] = 0
    assert depth_quality(frames, k, BASELINE).temporal_noise_percent == pytest.approx(0.4, rel=0.03)


def test_command_line(tmp_path, capsys):
    random = np.random.default_rng(4)
    names = []
    for i in range(3):
        depth = FOCAL_BASELINE / (FOCAL_BASELINE / plane(0.8) + random.normal(0, 0.1, SHAPE))
        names.append(str(tmp_path / f"depth{i}.png"))
        Image.fromarray(np.rint(1000 * depth).astype(np.uint16)).save(names[-1])
    options = ["--k", "420,420,319.5,239.5", "--baseline", "0.05"]
    assert main(["depth-quality", *names, *options, "--truth", "0.8"]) == 0
    out = capsys.readouterr().out
    for word in ("Fill-Rate", "Z Accuracy", "Plane Fit RMS Error", "Subpixel RMS Error", "Temporal Noise", "3 frames"):
        assert word in out
    assert "steps of 1 mm" not in out  # a thirtieth of a pixel here
    assert main(["depth-quality", *names, *options, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["subpixel_rms_px"] == pytest.approx(0.1, rel=0.15) and printed["frames"] == 3
    assert main(["depth-quality", names[0], "--k", "840,840,319.5,239.5", "--baseline", "0.1"]) == 0
    assert "note: the file's steps of 1 mm are 0.131 px here" in capsys.readouterr().out
    np.save(tmp_path / "stack.npy", np.stack([plane(0.8)] * 2))
    assert main(["depth-quality", str(tmp_path / "stack.npy"), *options]) == 0
    assert "Z Accuracy                     -" in capsys.readouterr().out
    holes = plane(0.8)
    holes[::7, ::5] = np.inf
    holes[1::7, ::5] = np.nan
    np.save(tmp_path / "holes.npy", holes)
    assert main(["depth-quality", str(tmp_path / "holes.npy"), *options]) == 0
    fit = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Plane Fit RMS Error"))
    assert float(fit.split()[-2]) < 1e-6
    np.save(tmp_path / "small.npy", plane(0.8)[:100])
    for wrong in ([names[0], str(tmp_path / "small.npy")], [str(tmp_path / "none.png")], [names[0], "--roi", "2"]):
        assert main(["depth-quality", *wrong, *options]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


def test_table_shows_what_is_missing():
    assert quality_table(depth_quality(plane(), K, BASELINE)).count(" -") == 2
