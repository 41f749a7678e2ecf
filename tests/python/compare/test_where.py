# SPDX-License-Identifier: Apache-2.0
"""Planted errors are found where they were planted, and noise is not called a
finding."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.capture.capture import Frame
from activestereo.common.pose import rigid_motion
from activestereo.effects.core.view import View
from activestereo.compare.where import (
    COVARIATES, GROUPS, BlockBootstrap, ResidualImage, benjamini_yekutieli, covariate_maps, gather_samples, interval,
    where_tables,
)  # fmt: skip

HEIGHT, WIDTH = 240, 424
FLOOR_DN2 = 4.0


def _maps(rng):
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    maps = {c.name: np.full((HEIGHT, WIDTH), np.nan, np.float32) for c in COVARIATES}
    maps["row"], maps["column"] = rows, columns
    maps["radius"] = np.hypot(rows - 119.5, columns - 211.5) / np.hypot(119.5, 211.5)
    blocks = 0.6 + 1.0 * rng.random((HEIGHT // 24, WIDTH // 8 + 1))
    maps["depth"] = blocks.repeat(24, 0).repeat(8, 1)[:, :WIDTH].astype(np.float32)
    return maps


def _images(rng, residual_of):
    images = []
    for pose in range(6):
        maps = _maps(rng)
        noise = rng.normal(scale=np.sqrt(FLOOR_DN2), size=(HEIGHT, WIDTH))
        residual = noise + residual_of(maps)
        floor, mask = np.full(residual.shape, FLOOR_DN2), np.ones(residual.shape, bool)
        images.append(ResidualImage(residual, floor, mask, maps, bytes([pose])))
    return images


@pytest.fixture(scope="module")
def planted():
    """A texture that the model lacks in the far corners alone."""
    rng = np.random.default_rng(3)
    return gather_samples(
        _images(
            rng, lambda m: ((m["radius"] > 0.6) & (m["depth"] > 1.1)) * rng.normal(scale=6.0, size=(HEIGHT, WIDTH))
        ),
        "DN",
        0,
    )


def test_tables_rank_the_planted_covariates_first(planted):
    tables = where_tables({"infrared": planted}, 0)
    assert {t["covariate"] for t in tables[:2]} <= {"radius", "depth", "column"}
    assert tables[0]["is_finding"] and tables[0]["q_value"] < 0.05
    far = next(t for t in tables if t["covariate"] == "depth")["bins"]
    assert all(b["excess_interval"][0] > 0 for b in far if b["low"] > 1.15)
    assert all(b["excess"] < 1.5 for b in far if b["high"] < 1.05)


def test_noise_alone_gives_no_findings():
    rng = np.random.default_rng(11)
    found = 0
    for _ in range(8):
        samples = gather_samples(_images(rng, lambda m: 0.0), "DN", 0)
        found += sum(t["q_value"] <= 0.05 for t in where_tables({"infrared": samples}, 0))
    assert found == 0


def test_static_blotches_do_not_fake_a_dependence():
    """Errors alike over 16-px blocks, without any covariate: pixels counted as independent would see hundreds of
    sigmas."""
    rng = np.random.default_rng(5)
    blotch = lambda m: rng.normal(scale=1.5, size=(15, 27)).repeat(16, 0).repeat(16, 1)[:, :WIDTH]  # noqa: E731
    tables = [t for _ in range(4) for t in where_tables({"infrared": gather_samples(_images(rng, blotch), "DN", 0)}, 0)]
    assert np.mean([t["q_value"] <= 0.05 for t in tables]) <= 0.1


def test_block_intervals_cover_the_truth():
    """Mean of block-correlated values: the 95 % interval holds the truth about 95 times of 100."""
    rng, inside = np.random.default_rng(7), 0
    bootstrap, ones = BlockBootstrap(GROUPS, 0, draws=800), np.full((GROUPS, 1), 20.0)
    for _ in range(200):
        sums = 20.0 * rng.normal(size=(GROUPS, 1)) + np.sqrt(20.0) * rng.normal(size=(GROUPS, 1))
        [(_, draws)] = bootstrap.ratios([sums], ones)
        low, high = interval(draws[:, 0])
        inside += low <= 0.0 <= high
    assert 180 <= inside <= 198


def test_benjamini_yekutieli_by_hand():
    c = 1 + 1 / 2 + 1 / 3
    np.testing.assert_allclose(
        benjamini_yekutieli([0.04, 0.001, 0.02]), [0.04 * c, 0.001 * 3 * c, 0.02 * 3 / 2 * c], rtol=1e-12
    )
    assert benjamini_yekutieli([0.9, 0.8]).max() == 1.0


def _plane_view(velocity=(0, 0, 0, 0, 0, 0), side="left"):
    """A wall 2 m ahead, seen straight on; the right half is 1 m away."""
    K = np.array([[200.0, 0, 80], [0, 200.0, 50], [0, 0, 1]])
    depth = np.full((101, 161), 2.0)
    depth[:, 81:] = 1.0
    normal = np.zeros((101, 161, 3))
    normal[..., 2] = -1.0
    shift = rigid_motion((-0.05 if side == "right" else 0.0, 0, 0))
    moving = {"camera_velocity": np.array(velocity, float)}
    frame = Frame(0, None, None, 0.5, 0.004, np.eye(4), "train", gain=2.0, temperature_c=None, **moving)
    projector_K = np.array([[20.0, 0, 31.5], [0, 20.0, 31.5], [0, 0, 1]])
    return View(side, K, depth, normal, np.ones((64, 64)), projector_K, np.eye(4), shift, frame)


def test_covariates_of_a_plane():
    maps = covariate_maps(_plane_view(), np.zeros((101, 161)), np.full((101, 161), 7.0), 0.05)
    assert maps["incidence"][50, 80] == pytest.approx(0.0, abs=1e-3)
    assert maps["incidence"][50, 0] == pytest.approx(np.degrees(np.arctan(0.4)), rel=1e-4)
    assert maps["disparity_fraction"][50, 30] == pytest.approx(0.0, abs=1e-5)  # 200 px x 0.05 m / 2 m = 5 px
    assert maps["edge_distance"][50, 80] == 0.0 and maps["edge_distance"][50, 70] == 10.0
    assert maps["radius"][0, 0] == pytest.approx(1.0) and maps["radius"][50, 80] == pytest.approx(0.0)
    assert maps["pattern_irradiance"][50, 80] == pytest.approx(1 / 2.0**2, rel=1e-6)
    assert maps["exposure"][0, 0] == pytest.approx(8.0) and np.isnan(maps["temperature"]).all()
    assert set(maps) == {c.name for c in COVARIATES}


@pytest.mark.parametrize("side", ["left", "right"])
def test_image_speed_is_that_of_projected_points(side):
    """Against the projection of a point at two times, the pose moved by a small step of the twist."""
    twist = np.array([0.3, -0.2, 0.1, 0.2, 0.5, -0.4])
    view = _plane_view(twist, side=side)
    maps = covariate_maps(view, np.zeros(view.shape), np.zeros(view.shape), 0.05)
    v, u, step = 20, 120, 1e-6
    spin = np.array([[0, -twist[5], twist[4]], [twist[5], 0, -twist[3]], [-twist[4], twist[3], 0]])
    generator = np.zeros((4, 4))
    generator[:3, :3], generator[:3, 3] = spin, twist[:3]
    left_to_then = np.eye(4) - step * generator
    point = np.append(view.points()[v, u], 1.0)
    then = view.left_to_camera @ left_to_then @ np.linalg.inv(view.left_to_camera) @ point
    at = view.K @ (then[:3] / then[2])
    assert maps["velocity"][v, u] == pytest.approx(np.hypot(at[0] - u, at[1] - v) / step, rel=1e-4)


def test_few_values_are_bins_of_their_own_and_the_undefined_is_none():
    rng = np.random.default_rng(1)
    images = _images(rng, lambda m: 0.0)
    for index, image in enumerate(images):
        image.maps["temperature"][:] = np.nan if index == 0 else (25.0 if index % 2 else 45.0)
    bins = gather_samples(images, "DN", 0).bins["temperature"]
    np.testing.assert_array_equal([bins.low, bins.high], [[25.0, 45.0]] * 2)
    assert np.count_nonzero(bins.code == 0) == HEIGHT * WIDTH


def test_no_pixels_no_samples():
    assert gather_samples([], "DN", 0) is None
    empty = SimpleNamespace(mask=np.zeros((4, 4), bool))
    assert gather_samples([empty], "DN", 0) is None
