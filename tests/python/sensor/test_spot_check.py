# SPDX-License-Identifier: Apache-2.0
"""SpotCheck's intervals hold what the whole run gives, on sensors whose differences are known."""

import numpy as np
import pytest

from spot_check import MEASURES, BoundExceededError, SpotCheck

SHAPE, FOCAL_BASELINE, DEPTH_M = (4, 12), 40.0, 2.0
TRUTH = FOCAL_BASELINE / DEPTH_M


class Recorded:
    """A traced sensor whose disparities were computed before."""

    def __init__(self, disparities):
        self.disparities, self.shown = disparities, None

    def take_picture(self, infrared_only=False):
        assert infrared_only

    def compute_depth(self):
        pass

    def get_disparity(self):
        return self.disparities[self.shown]


def frames(random, count, bias_px=0.1, noise=1.5):
    """Pairs of quick and traced disparities: their scatter and their holes differ from frame to frame."""
    scatter = random.uniform(0.02, 0.2, (count, 1, 1)) * (1.0, noise)
    quick, traced = (
        TRUTH + s[:, :, None] * random.standard_normal((count, *SHAPE)) for s in np.moveaxis(scatter, -1, 0)[::-1]
    )
    shared, own = random.random((count, *SHAPE)), random.random((2, count, *SHAPE))
    rate = random.uniform(0.05, 0.5, (count, 1, 1))
    quick, traced = (
        np.where((shared < rate) | (o < 0.05), 0.0, d) for o, d in zip(own, (quick + bias_px, traced), strict=True)
    )
    return quick, traced


def check(quick, traced, **options):
    sensor = Recorded(traced)
    spot = SpotCheck(sensor, lambda n: setattr(sensor, "shown", n), FOCAL_BASELINE, **options)
    kinds = np.broadcast_to(np.arange(SHAPE[1]) // 6, quick.shape)
    spot.see(quick, np.full(quick.shape, DEPTH_M), kinds)
    return spot


def test_intervals_hold_what_the_whole_run_gives():
    held = dict.fromkeys(MEASURES, 0)
    for run in range(100):
        quick, traced = frames(np.random.default_rng(run), 600)
        whole = check(quick, traced, share=1.0).report()
        found = check(quick, traced, share=0.08, seed=run).report()
        for name in MEASURES:
            held[name] += sum(found[k][name].low <= whole[k][name].value <= found[k][name].high for k in ("0", "1"))
    assert sum(held.values()) >= 0.93 * 100 * 2 * len(MEASURES)  # runs, materials


def test_what_is_known_is_found():
    spot = check(*frames(np.random.default_rng(1), 2000), share=1.0, names={0: "cup", 1: "table"})
    for estimates in spot.report().values():
        assert estimates["bias, px"].value == pytest.approx(0.1, abs=0.005)
        assert estimates["noise ratio"].value == pytest.approx(1.5, rel=0.05)
    assert str(spot).splitlines()[0] == "2000 of 2000 frames traced" and "\ncup: bias, px 0.099 (" in str(spot)


def test_frames_are_drawn_whatever_is_in_them():
    quick, traced = frames(np.random.default_rng(2), 400)
    chosen = [check(q, traced, share=0.1, seed=5).traced for q in (quick, 0.0 * quick)]
    assert chosen[0] == chosen[1] and 20 < chosen[0] < 60


def test_a_run_stops_at_its_bound_and_no_other_does():
    random, stopped = np.random.default_rng(3), 0
    bounds = {"bias, px": (-0.05, 0.05)}
    for _ in range(40):
        sensor = Recorded(None)
        spot = SpotCheck(sensor, lambda n, s=sensor: setattr(s, "shown", n), FOCAL_BASELINE, share=0.2, bounds=bounds)
        try:
            for _ in range(12):
                quick, sensor.disparities = frames(random, 40, bias_px=0.05)  # at the very edge
                spot.see(quick, np.full(quick.shape, DEPTH_M))
        except BoundExceededError:
            stopped += 1
    assert stopped <= 5  # of 40; 2 are expected
    quick, traced = frames(random, 200, bias_px=0.2)
    with pytest.raises(
        BoundExceededError, match=r"material 0: bias, px is 0\.2\d* \(.* after \d+ traced of 200 frames"
    ):
        check(quick, traced, share=0.2, bounds=bounds)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"share": 0.0}, "share above 0 and up to 1 of the frames, not 0.0"),
        ({"bounds": {"bias": (0, 1)}}, "bound 'bias' .* measures are bias, px"),
        ({"bounds": {"hole IoU": (1, 0)}}, "low to high"),
    ],
)
def test_bad_settings_are_told(options, words):
    with pytest.raises(ValueError, match=words):
        SpotCheck(Recorded(None), print, FOCAL_BASELINE, **options)


def test_images_of_different_sizes_are_told():
    spot = SpotCheck(Recorded(np.zeros((1, 3, 3))), print, FOCAL_BASELINE)
    with pytest.raises(ValueError, match=r"of one size, not \(1, 2, 2\), \(1, 3, 2\)"):
        spot.see(np.zeros((1, 2, 2)), np.zeros((1, 3, 2)))
