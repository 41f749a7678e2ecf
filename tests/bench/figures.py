# SPDX-License-Identifier: Apache-2.0
"""Writes examples/guide/figures.md: each figure of a page with its measuring command and its file of results."""

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "examples/guide/figures.md"
HEAD = """# How good it is

Each value is taken from its file of results, where machine and date stand. Pages quote no other figures; a test fails where one does.
[Benchmarks](../../tests/bench/README.md) and [the benchmark suite](../../tests/benchmark_suite/README.md) have further ones.

|measured|value|measure again by|results|
|--|--|--|--|
"""  # noqa: E501
# (measured, value). In braces: file.run:row:column of a benchmark; suite:measure or suite:strength:measure of the
# suite's generation, in percent, with its 95 % interval, or with :share without it; mitsuba:measure; next:frames;
# rooms:named.
FIGURES = (
    (
        "depth of a real D435 pair, against the depth that the device computed, after one affine fit",
        "median difference {accuracy.1:simsense, default:0} mm, {accuracy.1:simsense, default:2} % filled (OpenCV HH4 "
        "{accuracy.1:OpenCV HH4:0} mm)",
    ),
    (
        "pairs with truth, profile `active`: wrong or empty pixels",
        "{pairs.0:profile active:1} % (OpenCV 3WAY {pairs.0:OpenCV 3WAY:1} %)",
    ),
    (
        "walls of dots alone, 0.3 to 2 and 3 m, at full, half and a quarter of the size: RMS of a wall's error",
        "D415 {subpixel.1:D415:4} and {subpixel.1:D415:5} %, {subpixel.1:D415, half size:4} and "
        "{subpixel.1:D415, half size:5} %, {subpixel.1:D415, quarter size:4} and {subpixel.1:D415, quarter size:5} %; "
        "D435 {subpixel.1:D435:4} and {subpixel.1:D435:5} %, {subpixel.1:D435, half size:4} and "
        "{subpixel.1:D435, half size:5} %, {subpixel.1:D435, quarter size:4} and {subpixel.1:D435, quarter size:5} %",
    ),
    (
        "ten recordings of a D415 with a laser's depth: off by more than 2 px, plane noise, things widened, filled",
        "D415 {pairs.2:preset:2} %, {pairs.2:preset:6} px, {pairs.2:preset:7} px, {pairs.2:preset:0} %; its ASIC "
        "{pairs.2:ASIC:2} %, {pairs.2:ASIC:6} px, {pairs.2:ASIC:7} px, {pairs.2:ASIC:0} %",
    ),
    (
        "an empty background given a depth at full, half, a quarter of the size, 128x128",
        "D415 {invented.0:D415,1280x720:1}, {invented.0:D415,640x360:1}, {invented.0:D415,320x180:1}, "
        "{invented.0:D415,128x128:1} %; D435 {invented.0:D435,848x480:1}, {invented.0:D435,424x240:1}, "
        "{invented.0:D435,212x120:1}, {invented.0:D435,128x128:1} %",
    ),
    (
        "a black sheet, albedo 0.01, measured at these sizes",
        "D415 {invented.0:D415,1280x720:3}, {invented.0:D415,640x360:3}, {invented.0:D415,320x180:3}, "
        "{invented.0:D415,128x128:3} %; D435 {invented.0:D435,848x480:3}, {invented.0:D435,424x240:3}, "
        "{invented.0:D435,212x120:3}, {invented.0:D435,128x128:3} %",
    ),
    (
        "depth on others' images beside traced pictures, error over the noise: matt, gloss, metal",
        "{gbuffer.0:matt:2}, {gbuffer.0:gloss:2}, {gbuffer.0:metal:2}",
    ),
    (
        "time for equal noise on two cores over Mitsuba's: a room, a table",
        "{mitsuba.0:room:2}, {mitsuba.0:table:2}",
    ),
    (
        "matching 960x540, 128 disparities, two cores with AVX-512",
        "{matcher.0:D 128:0} ms (OpenCV HH4 {matcher.0:D 128:2} ms); with 7x7 blocks {matcher.0:D 128, block 7x7:0} ms",
    ),
    (
        "the same on an NVIDIA H200",
        "{matcher_vulkan.0:D 128:0} ms, in batches of 32 {matcher_vulkan.0:D 128, 32 pairs:0} ms",
    ),
    ("infrared image 960x540 of metal and glass, path depth 8, 8 samples, H200", "{render.0:8 samples:0} ms"),
    ("the whole sensor at 848x480, 2 samples, H200", "{sensor.1:2 samples:0} ms"),
    (
        "others' images to infrared, noise and matched depth, fixed exposure, 4096 environments of 64x64, H200",
        "{gbuffer_gpu.0:4096 of 64x64:0} pairs/s (a traced z-buffer alone {gbuffer_gpu.0:4096 of 64x64:1} frames/s)",
    ),
    (
        "the same for 1024 environments of 128x128",
        "{gbuffer_gpu.0:1024 of 128x128:0} pairs/s",
    ),
    (
        "a frame of `generate` without a GPU: RGB of 640x480, a D435, 16 samples",
        "{generate.0:one frame:0} processor seconds",
    ),
    (
        "walls rendered again through a measured pattern: error over the noise",
        "{calibrate.0:848x480, wall at 1.0 m:2} at 1 m, {calibrate.0:1.7 m:2} at 1.7 m",
    ),
    (
        "a calibrated twin's holes beside a real camera's (IoU); a raster pair's",
        "{realism.0:calibrated:0}; {realism.0:raster:0}",
    ),
    ("hidden effects named first, where detectable, in cases that nobody had looked at", "{suite:top-1}"),
    ("the same with a verdict `effect`", "{suite:named and right}"),
    (
        "two effects at once: both found; one of them first",
        "{suite:pairs: both found}; {suite:pairs: one of two first}",
    ),
    (
        "an effect that no library has: `unknown`; a wrong name",
        "{suite:outside the library: said so}; {suite:outside the library: wrong name}",
    ),
    ("nothing hidden: `none`", "{suite:no effect: said so}"),
    ("a fault of the depth engine named first", "{suite:depth engine's fault first:share}"),
    ("90 % intervals of parameters hold the truth", "{suite:90 % intervals hold the truth}"),
    ("weak effects, 0.4 of the noise, named", "{suite:weak:named and right}"),
    ("worlds of another renderer: first name right", "{mitsuba:another renderer: first name}"),
    ("twins told apart by the frames that were asked for; by random ones", "{next:asked}; {next:random}"),
    ("effects put into real recordings: named and right", "{rooms:named}"),
)
FOOT = """
The tests compare the renderer with physical laws: the inverse square law, conservation of energy (a white furnace),
reciprocity, Fresnel's and Snell's laws in glass, Beer's and Lambert's law in fog, closed forms of shutters and lenses,
and an independent path tracer in a Cornell box. The imager's noise is compared with the photon transfer law.
"""
SUITE = "tests/benchmark_suite/results"


def figures_page():
    """The page as text."""
    return HEAD + "".join(map(_row, FIGURES)) + FOOT


def _row(figure):
    measured, template = figure
    places = re.findall(r"\{([^}]+)\}", template)
    value = re.sub(r"\{([^}]+)\}", lambda found: _value(found.group(1)), template)
    command, file = _source(places[0])
    name = Path(file).name.removesuffix(".json")
    return f"|{measured}|{value}|`{_short(command)}`|[{name}](../../{file})|\n"


def _short(command):
    return command.removeprefix("PYTHONPATH=build/python ").removeprefix("/usr/bin/").removeprefix("python3 ")


def _source(place):
    """(command, file of results) of a place."""
    kind = place.partition(":")[0]
    if kind == "rooms":
        file = "examples/real_camera/results.json"
        return _read(file)["injected"]["command"], file
    file = _file(kind)
    results = _read(file)
    return (results["runs"][int(kind.split(".")[1])] if "runs" in results else results)["command"], file


def _file(kind):
    if kind == "suite":
        [run] = (ROOT / SUITE).glob("generation-*.json")
        return f"{SUITE}/{run.name}"
    folder = SUITE if kind in ("mitsuba", "next") else "tests/bench/results"
    return f"{folder}/{kind.split('.')[0]}.json"


def _value(place):
    kind, _, rest = place.partition(":")
    if kind == "rooms":
        said = [text for row in _read("examples/real_camera/results.json")["injected"]["rows"] for text in row[1:]]
        named, ran = (sum(map(had, said)) for had in (lambda text: text.startswith("named"), lambda text: text != "-"))
        return f"{named} of {ran}"
    results = _read(_file(kind))
    if kind == "next":
        return f"{results[rest]['resolved']} of {results[rest]['n']}"
    if "runs" in results:
        row, _, column = rest.rpartition(":")
        return str(results["runs"][int(kind.split(".")[1])]["rows"][row][int(column)])
    name, _, how = rest.rpartition(":")
    if how != "share":
        name, how = rest, ""
    strength, _, of_strength = name.partition(":")
    by_strength = results.get("by_strength", {})
    measure = by_strength[strength][of_strength] if strength in by_strength else results["measures"][name]
    if how == "share" or kind == "mitsuba":
        return f"{round(measure['value'] * measure['n'])} of {measure['n']}"
    return "{value:.0f} % ({low:.0f} to {high:.0f})".format(
        **{key: 100 * measure[key] for key in ("value", "low", "high")}
    )


def _read(file):
    return json.loads((ROOT / file).read_text())
