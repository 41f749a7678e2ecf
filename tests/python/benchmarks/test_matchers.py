# SPDX-License-Identifier: Apache-2.0
"""The benchmark of matchers, on pairs whose truth is written down here."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo import StereoDepthSensorConfig
from matchers.pairs import MATERIALS, Pairs, joined, seen_by_both
from matchers.report import table, write_report
from matchers.score import EMITTERS, matchers, score, scores

_NAN, _SHIFT, _SIZE = np.nan, 12, (96, 160)


def test_a_score_counts_what_is_unmeasured_and_what_is_off_by_more_than_a_pixel():
    found = np.array([5.0, 5.5, 7.0, _NAN, 9.0], np.float32)
    truth = np.array([5.0, 5.0, 5.0, 5.0, _NAN], np.float32)
    one = score(found, truth)
    assert (one.measured, one.wrong, one.lost) == (0.75, pytest.approx(1 / 3), 0.5)
    assert one.spread_px == pytest.approx(np.sqrt(0.125))
    assert np.isnan(score(found, np.full(5, _NAN, np.float32)).lost)


def test_only_what_both_cameras_see_has_a_truth():
    truth = np.full((1, 1, 40), 4.0, np.float32)
    truth[..., 20:30] = 10.0  # hides four to six columns of the background to its left in the right image
    seen = np.isfinite(seen_by_both(truth))[0, 0]
    assert not seen[:4].any(), "beside the right image"
    assert seen[20:30].all() and seen[5:13].all() and seen[31:].all()
    assert not seen[15:19].any()


def _pairs(seed):
    wall = np.random.default_rng(seed).integers(20, 200, (1, _SIZE[0], _SIZE[1] + _SHIFT), np.uint8)
    truth = np.full((1, *_SIZE), _SHIFT, np.float32)
    truth[..., : _SHIFT + 8] = _NAN
    return Pairs(wall[..., : _SIZE[1]], wall[..., _SHIFT:], truth, np.zeros((1, *_SIZE), np.uint8))


@pytest.fixture
def config():
    config = StereoDepthSensorConfig("D435")
    config.ir_resolution, config.max_disparity = _SIZE[::-1], 32
    config.ir_intrinsic = np.array([[100.0, 0, 79.5], [0, 100, 47.5], [0, 0, 1]])
    return config


def test_each_matcher_finds_a_textured_wall_and_a_blank_pair_is_lost(config, tmp_path):
    blank = np.zeros((1, *_SIZE), np.uint8)
    lit = _pairs(1)
    studio = SimpleNamespace(take=lambda seed: {"on": lit, "off": Pairs(blank, blank, lit.truth, lit.material)})
    known = matchers(config, {"active": {"p1": 12, "p2": 32}}, [])
    assert list(known) == ["simsense active", "simsense D435", "OpenCV SGBM", "OpenCV BM"]
    found = scores(studio, known, 2, 0)
    for name, own in found.items():
        assert own["on"]["table"].lost < 0.25, name  # BM leaves the borders out
        assert own["in turn"]["all"].lost <= own["on"]["all"].lost + 1e-9, name
        assert np.isnan(own["on"]["glass"].lost), name
    write_report(found, tmp_path, {"seed": 0})
    kept = json.loads((tmp_path / "matchers.json").read_text())
    assert kept["matchers"]["OpenCV BM"]["off"]["table"]["lost"] == found["OpenCV BM"]["off"]["table"].lost
    assert (tmp_path / "matchers.png").stat().st_size > 1000
    assert len(table(found)) == 2 + len(known) * len(EMITTERS) and MATERIALS[-1] in table(found)[0]


def test_parts_are_joined_in_order():
    both = joined([_pairs(1), _pairs(2)])
    assert both.left.shape == (2, *_SIZE)
    np.testing.assert_array_equal(both.right[1], _pairs(2).right[0])
