# SPDX-License-Identifier: Apache-2.0
"""On a slope of every fraction of a pixel the default's pull to whole pixels is at most half the parabola's."""

from bench_accuracy import locking_curve, sloped_dots
from bench_pairs import ours


def test_default_step_halves_the_parabolas_bias():
    left, right, truth = sloped_dots(720, 400)
    bias = {}
    for name, settings in {"default": {}, "parabola": {"subpixel": "parabola"}, "none": {"subpixel": "none"}}.items():
        curve, bias[name] = locking_curve(ours(p1=7, p2=86, **settings)(left, right, 128), truth, bins=20)
        assert len(curve) == 20
    assert bias["default"] <= 0.5 * bias["parabola"], bias
    assert bias["parabola"] < 0.1 < bias["none"], bias
