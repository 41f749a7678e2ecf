# SPDX-License-Identifier: Apache-2.0
"""EMVA 1288: cameras whose parameters are known are measured from their frames, drawn by NumPy and by simsense."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from activestereo.calibrate.emva1288 import Recording, Step, measure, step_of
from activestereo.capture.images import write_gray
from activestereo.model import Quantity, read_model
from command_line import refused, run_here
from drawn_camera import BLACK, COLUMN, DSNU, EFFICIENCY, GAIN, PRNU, ROW, SIGMA, SIZE, STEPS, WAVE, Camera


def inside(value: float, quantity: Quantity) -> bool:
    return quantity.low <= value <= quantity.high


def test_intervals_hold():
    """Nine in ten of 60 cameras lie inside each interval, less what chance takes one time in a thousand."""
    cameras, hits = 60, {}
    for seed in range(cameras):
        found = measure(Camera(seed).recording())
        dark = found.spatial.dark
        for name, truth, quantity in (
            ("gain", GAIN, found.transfer.gain), ("dark noise", SIGMA, found.transfer.dark_noise),
            ("black", BLACK, found.black), ("responsivity", GAIN * EFFICIENCY, found.responsivity),
            ("prnu", PRNU, found.prnu), ("pixel", DSNU, dark.pixel), ("column", COLUMN, dark.column),
            ("row", ROW, dark.row), ("wave", WAVE, dark.waves[0].amplitude),
        ):  # fmt: skip
            hits[name] = hits.get(name, 0) + inside(truth, quantity)
    assert min(hits.values()) >= binom.ppf(1e-3, cameras, 0.9), hits
    assert sum(hits.values()) <= 0.96 * cameras * len(hits), hits  # nor are they wide for nothing


def test_without_photons_the_gain_is_that_of_a_straight_response():
    camera = Camera(1, bend=0.0)
    found = measure(camera.recording(known=False)).transfer
    assert inside(GAIN, found.gain) and found.responsivity is None and found.response is None


def test_a_gain_of_few_counts_is_told_by_lit_steps():
    """Rounding hides a dark noise of 0.2 counts."""
    rng = np.random.default_rng(3)

    def step(photons: float, frames: int = 2) -> Step:
        size = (128, 128)
        dn = (0.05 * rng.poisson(0.5 * photons, size) + rng.normal(5.3, 0.2, size) for _ in range(frames))
        return step_of((np.rint(frame).astype(np.uint8) for frame in dn), 255, 0.0, photons, "drawn")

    found = measure(Recording("drawn", 8, tuple(step(p) for p in (*np.linspace(500.0, 9000.0, 20), 0.0)))).transfer
    assert inside(0.2, found.dark_noise) and inside(0.05, found.gain)


def written(folder: Path, change=lambda lines: lines, size: tuple[int, int] = SIZE, frames: int = 20) -> Path:
    """A descriptor file and its images."""
    camera = Camera(8, size)
    lines = ["# drawn", "v 3.1", f"n 12 {size[1]} {size[0]}"]
    levels = [(photons, 2) for photons in (*STEPS, 0.0)] + [(4e4, frames), (0.0, frames)]
    for place, (photons, count) in enumerate(levels):
        lines.append(f"b 1000000.0 {photons:.1f}" if photons else "d 1000000.0")
        for number in range(count):
            name = f"{place:02d}_{number:02d}.png"
            write_gray(folder / name, camera.frame(photons))
            lines.append(f"i {name}")
    path = folder / "EMVA1288_Data.txt"
    path.write_text("\n".join(change(lines)) + "\n")
    return path


def test_the_command_reads_a_descriptor_into_a_model(tmp_path, capsys):
    path, out = written(tmp_path), tmp_path / "model.json"
    effects = [{"id": "prnu", "parameters": {"sigma": 0.3}}, {"id": "haze", "parameters": {}}]
    out.write_text(json.dumps({"format": "active-stereo-model", "version": 2, "effects": effects}))
    result = run_here(capsys, "calibrate", "noise", path, "-o", out, "--verbose")
    assert result.returncode == 0, result.stderr
    for words in ("12 steps of light", "system gain K", "DSNU columns", "wave in the dark"):
        assert words in result.stdout
    model = read_model(out)
    assert {entry.effect.id for entry in model.effects} == {"prnu", "haze", "fixed_pattern_noise"}
    sigma = next(entry for entry in model.effects if entry.effect.id == "prnu").parameters["sigma"]
    assert inside(PRNU, sigma) and inside(GAIN, model.imager.shot) and inside(BLACK, model.nuisances["black_dn"])


def test_folders_of_pairs_are_steps_of_light(tmp_path, capsys):
    camera = Camera(6, bend=0.0)
    for place, photons in enumerate((*STEPS[:6], 0.0)):
        folder = tmp_path / ("dark" if photons == 0.0 else f"lit/{place}")
        folder.mkdir(parents=True)
        for number in range(2):
            write_gray(folder / f"{number}.png", camera.frame(photons))
    out = tmp_path / "model.json"
    words = ("--dark", tmp_path / "dark", "-o", out, "--verbose")
    result = run_here(capsys, "calibrate", "noise", tmp_path / "lit", *words)
    assert result.returncode == 0, result.stderr
    assert inside(GAIN, read_model(out).imager.shot) and "record 3 or more frames" in result.stdout
    assert "cover the lens" in refused(["calibrate", "noise", tmp_path / "lit", "-o", out], capsys)


def without(start: str, count: int = 3):
    """Leaves out the first line that starts so, and those after it."""

    def change(lines):
        at = next(i for i, line in enumerate(lines) if line.startswith(start))
        return lines[:at] + lines[at + count :]

    return change


def swapped(old: str, new: str):
    return lambda lines: [line.replace(old, new, 1) if line.startswith(old) else line for line in lines]


@pytest.mark.parametrize(
    "light, says",
    [
        ((5e5, 6e5, 7e5, 8e5), "4 of 4 steps of light have counts that clip at 0 or 4095"),
        ((7e4, 7.2e4, 7.4e4, 7.6e4), "0 of 4 steps of light lie below 70 % of saturation: record ten or more"),
        ((0.5, 0.5, 0.5, 0.5), "record"),
    ],
)
def test_steps_that_tell_nothing_are_refused(light, says):
    camera = Camera(9)
    steps = [camera.step(photons) for photons in (*light, 0.0)]
    with pytest.raises(ValueError, match=says):
        measure(Recording("drawn", 12, tuple(steps)))


@pytest.mark.parametrize("size, says", [((8, 64), "64x8 pixels"), ((64, 64), "half a count of noise")])
def test_frames_without_noise_or_pixels_are_refused(size, says):
    """Counts that all agree are no reason to divide by zero."""

    def step(level: int, frames: int) -> Step:
        return step_of([np.full(size, 10 + level, np.uint8)] * frames, 255, 0.0, float(level), "drawn")

    steps = [step(level, 2) for level in range(0, 200, 20)] + [step(100, 3), step(0, 3)]
    if size[0] < 16:
        steps = [replace(s, variance_dn2=0.5 + 0.1 * s.photons) for s in steps]
    with pytest.raises(ValueError, match=says):
        measure(Recording("drawn", 8, tuple(steps)))


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda lines: lines[:6] + lines[39:42], "1 step of light: the gain needs 3 or more"),
        (lambda lines: [x for x in lines if not x.startswith("n")], "has no line 'n BITS WIDTH HEIGHT'"),
        (swapped("n 12 64", "n 12 65"), "is 64x48, expected 65x48: record all steps with one setting"),
        (swapped("n 12", "n 8"), "line 'n' states at most 255"),
        (swapped("d 1000000", "d 2000000"), "no dark frames of its exposure time, 0.001 s"),
        (lambda lines: [x for x in lines if x != "i 01_01.png"], ":7: has 1 frame: record two of each step"),
        (swapped("i 01_01.png", "i 05_01.png"), ":7: the frames' means differ by"),
        (swapped("i 01_01.png", "i none.png"), ":7: "),
        (swapped("b 1000000.0 4000.0", "b 1000000.0 x"), ":4: 'x' is no number"),
        (swapped("b 1000000.0 4000.0", "b 1000000.0 0"), ":4: has 0 photons"),
        (swapped("v 3.1", "what is this"), ":2: is 'what is this', expected a line"),
        (lambda lines: ["i 01_01.png", *lines], ":1: an image before any line"),
        (swapped("b 1000000.0 50909.1", "b 1000000.0 30000.0"), "off what the others tell: let the lamp warm up"),
        (lambda lines: [x for x in lines if not x.startswith(("d", "i 12", "i 14"))], "no dark frames: cover the lens"),
    ],
)
def test_bad_recordings_are_refused_in_one_line(change, says, tmp_path, capsys):
    path, out = written(tmp_path, change, frames=3), tmp_path / "model.json"
    assert says in refused(["calibrate", "noise", path, "-o", out], capsys)
    assert not out.exists()
