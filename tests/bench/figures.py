# SPDX-License-Identifier: Apache-2.0
"""The page examples/guide/figures.md: the main figures, taken from the results of the benchmarks and the benchmark
suite."""

import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "examples/guide/figures.md"
TEMPLATE = """# How good it is

The values come from the data of the [benchmarks](../../tests/bench/README.md) and of [the benchmark suite](../../tests/benchmark_suite/README.md),
where all others stand with their machine and date.

|measured|value|measure again by|
|--|--|--|
|depth of a real D435 pair, against the depth that the device computed, after one affine fit|median difference {accuracy.1:simsense, default:0} mm, {accuracy.1:simsense, default:2} % filled (device 92.3 %; OpenCV HH4 {accuracy.1:OpenCV HH4:0} mm)|`bench_accuracy.py`|
|pairs with truth, profile `active`: wrong or empty pixels|{pairs.0:profile active:1} % (OpenCV 3WAY {pairs.0:OpenCV 3WAY:1} %)|`bench_pairs.py`|
|matching 960x540, 128 disparities, two cores with AVX-512|{matcher.0:D 128:0} ms (OpenCV HH4 {matcher.0:D 128:2} ms); with 7x7 blocks {matcher.0:D 128, block 7x7:0} ms|`bench_matcher`|
|the same on an NVIDIA H200|{matcher_vulkan.0:D 128:0} ms, in batches of 32 {matcher_vulkan.0:D 128, 32 pairs:0} ms|`bench_matcher_vulkan`|
|infrared image 960x540 of metal and glass, path depth 8, 8 samples, H200|{render.0:8 samples:0} ms|`bench_render`|
|the whole sensor at 848x480, 2 samples, H200|{sensor.1:2 samples, infrared and depth:0} ms|`bench_sensor.py`|
|walls rendered again through a measured pattern: error over the noise|{calibrate.0:848x480, wall at 1.0 m:2} at 1 m, {calibrate.0:1.7 m:2} at 1.7 m|`bench_calibrate.py wall`|
|hidden effects named first, where detectable|{suite} of test cases that nobody had looked at|`run_suite.py`|

The tests compare the renderer with physical laws: the inverse square law, conservation of energy (a white furnace),
reciprocity, Fresnel's and Snell's laws in glass, Beer's and Lambert's law in fog, closed forms of shutters and lenses,
and an independent path tracer in a Cornell box. The imager's noise is compared with the photon transfer law.
"""  # noqa: E501


def figures_page():
    """The page as text; each {file.run:row:column} of the template is a value of a file of results."""
    text, page = TEMPLATE, []
    while "{" in text:
        before, _, text = text.partition("{")
        place, _, text = text.partition("}")
        page += [before, _suite() if place == "suite" else _value(place)]
    return "".join([*page, text])


def _value(place):
    source, row, column = place.split(":")
    name, run = source.split(".")
    results = json.loads((ROOT / f"tests/bench/results/{name}.json").read_text())
    return str(results["runs"][int(run)]["rows"][row][int(column)])


def _suite():
    newest = max((ROOT / "tests/benchmark_suite/results").glob("generation-*.json"))
    first = json.loads(newest.read_text())["measures"]["top-1"]
    return f"{100 * first['value']:.0f} % ({100 * first['low']:.0f} to {100 * first['high']:.0f} %)"
