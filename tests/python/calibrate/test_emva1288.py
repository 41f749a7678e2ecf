# SPDX-License-Identifier: Apache-2.0
"""EMVA 1288: cameras whose gain and noise are known are measured from their frames: drawn by NumPy, by simsense, and by
the standard's reference sets (CC BY-SA 3.0, github.com/EMVA1288/datasets) in the folder EMVA1288_DATASETS."""

import logging
import os
from pathlib import Path

import numpy as np
import pytest
import simsense
from scipy.stats import binom

from activestereo.calibrate.emva1288 import PhotonTransfer, Step, calibrate_emva1288, photon_transfer, step_of
from activestereo.capture.images import write_gray
from activestereo.model import Quantity, read_model
from command_line import refused, run_here

# A camera of 12 bits: DN and shares.
GAIN, SIGMA, BLACK, PRNU, DSNU = 0.1, 3.0, 29.4, 0.006, 1.5
EFFICIENCY, BEND, MAX_DN = 0.5, 0.03, 4095
SIZE = (48, 64)
STEPS = np.linspace(4e3, 9e4, 12)


class Camera:
    """frame(photons) draws one; fixed patterns are drawn once."""

    def __init__(self, seed: int, bend: float = BEND, size: tuple[int, int] = SIZE) -> None:
        self.rng, self.bend = np.random.default_rng(seed), bend
        self.sensitivity = 1.0 + PRNU * self.rng.standard_normal(size)
        self.offset = BLACK + DSNU * self.rng.standard_normal(size)

    def frame(self, photons: float) -> np.ndarray:
        electrons = self.rng.poisson(photons * EFFICIENCY * self.sensitivity)
        dn = GAIN * electrons + self.rng.normal(0.0, SIGMA, electrons.shape)
        dn = dn * (1.0 - self.bend * (dn / MAX_DN) ** 2)
        return np.rint(dn + self.offset).clip(0, MAX_DN).astype(np.uint16)

    def measured(self, light=STEPS) -> PhotonTransfer:
        steps = [step_of([self.frame(p), self.frame(p)], MAX_DN, 1e-3, p == 0.0, f"{p:.0f}") for p in (*light, 0.0)]
        return photon_transfer("drawn", steps)


def inside(value: float, quantity: Quantity) -> bool:
    return quantity.low <= value <= quantity.high


def test_intervals_hold():
    """Nine in ten of 60 cameras lie inside each interval, less what chance takes one time in a thousand."""
    cameras, hits = 60, {}
    for seed in range(cameras):
        camera = Camera(seed, bend=0.0)
        found = camera.measured()
        for name, truth, quantity in (
            ("gain", GAIN, found.gain),
            ("dark noise", SIGMA, found.dark_noise),
            ("black", camera.offset.mean(), found.black),
        ):
            hits[name] = hits.get(name, 0) + inside(truth, quantity)
    assert min(hits.values()) >= binom.ppf(1e-3, cameras, 0.9), hits
    assert sum(hits.values()) <= 0.98 * cameras * len(hits), hits  # nor are they wide for nothing


def test_a_bent_response_has_the_gain_of_weak_light():
    found = [Camera(seed, bend=0.1, size=(192, 256)).measured(np.linspace(2e3, 9e4, 30)).gain for seed in range(4)]
    assert np.mean([gain.value for gain in found]) == pytest.approx(GAIN, rel=0.01)


def test_a_gain_of_few_counts_is_told_by_lit_steps():
    """Rounding hides a dark noise of 0.2 counts."""
    rng = np.random.default_rng(3)

    def step(photons: float) -> Step:
        drawn = 0.05 * rng.poisson(0.5 * photons, (2, 128, 128)) + rng.normal(5.3, 0.2, (2, 128, 128))
        return step_of(np.rint(drawn).astype(np.uint8), 255, 0.0, photons == 0.0, "drawn")

    found = photon_transfer("drawn", [step(p) for p in (*np.linspace(500.0, 9000.0, 20), 0.0)])
    assert inside(0.2, found.dark_noise) and inside(0.05, found.gain)


def test_simsense_gives_back_what_was_put_in():
    """Its dark current is on the line of the light, and the black level is that of no exposure."""
    signal = {
        "responsivity_e": 1.0, "shot_noise": 1.0, "conversion_gain_dn_per_e": 0.05, "read_noise_e": 14.0,
        "full_well_e": 60000.0, "dark_current_e_per_s": 700.0, "prnu": 0.012, "black_level_dn": 60.0, "bit_depth": 12,
    }  # fmt: skip
    k = np.array([[200.0, 0, 128], [0, 200.0, 96], [0, 0, 1]])
    side, left_to_right = simsense.Camera(256, 192, k), np.eye(4)
    left_to_right[0, 3] = -0.05
    engine = simsense.Engine(simsense.Device("host"), side, side, left_to_right, rectified=True, **signal)
    taken = iter(range(10**6))

    def step(exposure_s: float, light: float) -> Step:
        image, frames = np.full((192, 256), light, np.float32), []
        for _ in range(2):
            engine.set_parameters(exposure_s=exposure_s, frame_index=next(taken))
            frames.append(engine.compute(image, image, ("ir_left",))["ir_left"].copy())
        return step_of(frames, MAX_DN, exposure_s, light == 0.0, "")

    found = photon_transfer("simsense", [step(t, p) for t in np.linspace(0.02, 1.0, 50) for p in (0.0, 7e4)])
    for truth, quantity in ((0.05, found.gain), (0.7, found.dark_noise), (60.0, found.black)):
        off = abs(truth - quantity.value) / (quantity.high - quantity.value)
        assert off < 2.4, quantity  # four standard deviations


@pytest.mark.parametrize(
    "name, gain, noise_dn",
    [
        ("EMVA1288_ReferenceSet_001_CCD_12Bit", 0.280063, 3.07310),
        ("EMVA1288_ReferenceSet_003_Simulation_12Bit", 0.1, np.hypot(3.0, np.sqrt(1.0 / 12.0))),
    ],
)
def test_a_reference_set_gives_its_figures(name, gain, noise_dn):
    """The CCD's are those of the package emva1288 1.0.2, whose line is straight; the simulation states its own."""
    if not (folder := os.environ.get("EMVA1288_DATASETS")):
        pytest.skip("EMVA1288_DATASETS names no checkout of github.com/EMVA1288/datasets")
    found = calibrate_emva1288(Path(folder) / name / "EMVA1288_Data.txt")
    assert found.gain.value == pytest.approx(gain, rel=0.05 if "CCD" in name else 0.01)
    assert np.hypot(found.dark_noise.value, np.sqrt(1.0 / 12.0)) == pytest.approx(noise_dn, rel=0.01)


def written(folder: Path, change=lambda lines: lines) -> Path:
    """A descriptor file and its images."""
    camera, lines = Camera(8, bend=0.0), ["# drawn", "v 3.1", f"n 12 {SIZE[1]} {SIZE[0]}"]
    for place, (photons, count) in enumerate([(p, 2) for p in (*STEPS, 0.0)] + [(4e4, 8), (0.0, 8)]):
        lines.append(f"b 1000000.0 {photons:.1f}" if photons else "d 1000000.0")
        for number in range(count):
            name = f"{place:02d}_{number:02d}.png"
            write_gray(folder / name, camera.frame(photons))
            lines.append(f"i {name}")
    path = folder / "EMVA1288_Data.txt"
    path.write_text("\n".join(change(lines)) + "\n")
    return path


def test_the_standards_own_program_agrees(tmp_path):
    process = pytest.importorskip(
        "emva1288.process", reason="the package emva1288 is not installed (pip install emva1288)"
    )
    path, quiet = written(tmp_path), {"loglevel": logging.ERROR}
    parsed = process.ParseEmvaDescriptorFile(str(path), **quiet)
    data = process.Data1288(process.LoadImageData(parsed.images, **quiet).data, **quiet)
    theirs, found = process.Results1288(data.data, **quiet), calibrate_emva1288(path)
    assert found.gain.value == pytest.approx(theirs.K, rel=0.05)
    assert np.hypot(found.dark_noise.value, np.sqrt(1.0 / 12.0)) == pytest.approx(theirs.sigma_y_dark, rel=0.05)


def test_the_command_reads_a_descriptor_into_a_model(tmp_path, capsys):
    out = tmp_path / "model.json"
    result = run_here(capsys, "calibrate", "noise", written(tmp_path), "-o", out, "--verbose")
    assert result.returncode == 0, result.stderr
    assert "13 steps of light" in result.stdout and "system gain K" in result.stdout
    model = read_model(out)
    assert model.imager.shot.value == pytest.approx(GAIN, rel=0.05)
    assert model.imager.offset.value == pytest.approx(SIGMA**2 + 1.0 / 12.0, rel=0.05)
    assert model.nuisances["black_dn"].value == pytest.approx(BLACK, abs=0.2)


def test_folders_of_pairs_are_steps_of_light(tmp_path, capsys):
    camera = Camera(6, bend=0.0)
    for place, photons in enumerate((*STEPS[:6], 0.0)):
        folder = tmp_path / ("dark" if photons == 0.0 else f"lit/{place}")
        folder.mkdir(parents=True)
        for number in range(2):
            write_gray(folder / f"{number}.png", camera.frame(photons))
    out = tmp_path / "model.json"
    result = run_here(capsys, "calibrate", "noise", tmp_path / "lit", "--dark", tmp_path / "dark", "-o", out)
    assert result.returncode == 0, result.stderr
    assert inside(GAIN, read_model(out).imager.shot)
    assert "cover the lens" in refused(["calibrate", "noise", tmp_path / "lit", "-o", out], capsys)


@pytest.mark.parametrize(
    "light, says",
    [
        ((5e5, 6e5, 7e5, 8e5), "0 of 4 steps of light lie below 70 % of saturation"),
        ((7e4, 7.2e4, 7.4e4, 7.6e4), "0 of 4 steps of light lie below 70 % of saturation"),
        ((0.5, 0.5, 0.5, 0.5), "record"),
    ],
)
def test_steps_that_tell_nothing_are_refused(light, says):
    with pytest.raises(ValueError, match=says):
        Camera(9).measured(light)


def test_frames_without_noise_are_refused():
    """Counts that all agree are no reason to divide by zero."""
    steps = [step_of([np.full((64, 64), 10 + n, np.uint8)] * 2, 255, 0.0, n == 0, "drawn") for n in range(0, 200, 20)]
    with pytest.raises(ValueError, match="half a count of noise"):
        photon_transfer("drawn", steps)


def swapped(old: str, new: str):
    return lambda lines: [line.replace(old, new, 1) if line.startswith(old) else line for line in lines]


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda lines: lines[:6] + lines[39:42], "0 of 1 steps of light lie below"),
        (lambda lines: [x for x in lines if not x.startswith("n")], "has no line 'n BITS WIDTH HEIGHT'"),
        (swapped("n 12 64", "n 12 65"), "is 64x48, expected 65x48: record all steps with one setting"),
        (swapped("n 12", "n 8"), "line 'n' states at most 255"),
        (lambda lines: [x for x in lines if x != "i 01_01.png"], ":7: has 1 frame: record two of each step"),
        (swapped("i 01_01.png", "i 05_01.png"), ":7: the frames' means differ by"),
        (swapped("i 01_01.png", "i none.png"), ":7: "),
        (swapped("b 1000000.0 4000.0", "b 1000000.0 x"), ":4: is 'b 1000000.0 x', expected a line"),
        (swapped("b 1000000.0 4000.0", "b 1000000.0 0"), ":4: has 0 photons"),
        (swapped("v 3.1", "what is this"), ":2: is 'what is this', expected a line"),
        (lambda lines: ["i 01_01.png", *lines], ":1: an image before any line"),
        (lambda lines: [x for x in lines if not x.startswith(("d", "i 12", "i 14"))], "no dark frames: cover the lens"),
    ],
)
def test_bad_recordings_are_refused_in_one_line(change, says, tmp_path, capsys):
    path, out = written(tmp_path, change), tmp_path / "model.json"
    assert says in refused(["calibrate", "noise", path, "-o", out], capsys)
    assert not out.exists()
