# SPDX-License-Identifier: Apache-2.0
"""Subpixel steps on a slope that passes every fraction of a pixel: the default's pull towards whole pixels is at most
half of the parabola's."""

import importlib.util
from pathlib import Path

import pytest

_BENCH = Path(__file__).parents[2] / "bench" / "bench_accuracy.py"


@pytest.fixture(scope="module")
def bench():
    spec = importlib.util.spec_from_file_location("bench_accuracy", _BENCH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_default_step_halves_the_parabolas_bias(bench):
    left, right, truth = bench.sloped_dots(720, 400)
    bias = {}
    for name, settings in {"default": {}, "parabola": {"subpixel": "parabola"}, "none": {"subpixel": "none"}}.items():
        curve, bias[name] = bench.locking_curve(bench.engine(**settings)(left, right), truth, bins=20)
        assert len(curve) == 20
    assert bias["default"] <= 0.5 * bias["parabola"], bias
    assert bias["parabola"] < 0.1 < bias["none"], bias
