# SPDX-License-Identifier: Apache-2.0
"""Noise from repeats: drawn by NumPy and by simsense from noise models that are known, and read back."""

import json

import numpy as np
import pytest
import simsense

from activestereo import StereoDepthSensorConfig
from activestereo.calibrate.noise import Repeats
from activestereo.model.write import replace_sections
from activestereo.calibrate.noise import calibrate_noise
from activestereo.calibrate.noise_fit import GammaModel, ShotModel
from activestereo.cli import main
from activestereo.capture.images import write_gray
from activestereo.model import read_model
from command_line import refused

_SIZE = (40, 64)


def clean_image(seed: int, low: float = 0.4, high: float = 110.0, size: tuple[int, int] = _SIZE) -> np.ndarray:
    """Counts above black: levels spread over the range, in blocks."""
    rng = np.random.default_rng(seed)
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


def drawn(noise_model: GammaModel | ShotModel, clean: np.ndarray, repeats: int, seed: int) -> np.ndarray:
    """Repeats by NumPy's own generators."""
    rng, shape, k = np.random.default_rng(seed), (repeats, *clean.shape), noise_model.shape
    is_gamma = noise_model.name == "gamma"
    light = clean * rng.gamma(k, 1.0 / k, shape) if is_gamma else k * rng.poisson(clean / k, shape)
    counts = np.rint(light + noise_model.black_dn + rng.normal(0.0, noise_model.sigma_dn, shape))
    return counts.clip(0, 255).astype(np.uint8)


def views(noise_model: GammaModel | ShotModel, repeats: int, seed: int = 0, **more: float) -> list[Repeats]:
    return [Repeats("view", drawn(noise_model, clean_image(seed, **more), repeats, seed + 1))]


def dark(noise_model: GammaModel | ShotModel, seed: int = 7) -> list[Repeats]:
    return [Repeats("dark", drawn(noise_model, np.full(_SIZE, 1e-9), 12, seed))]


@pytest.mark.parametrize(
    "noise_model",
    [GammaModel(4.0, 0.8, 5.0), GammaModel(40.0, 0.5, -0.4), ShotModel(0.3, 0.6, 5.0), ShotModel(2.0, 0.4, 3.0)],
)
def test_a_table_is_the_histogram_of_draws(noise_model):
    """10^5 draws of NumPy's generators at two levels: chi-square of the counts with enough expected."""
    for level in (1.5, 60.0):
        counts = drawn(noise_model, np.full((100, 100), level), 10, 3)
        seen = np.bincount(counts.ravel(), minlength=256)
        expected = counts.size * np.exp(noise_model.log_probabilities(np.array([level]), 255)[0])
        enough = expected > 20
        chi2 = float(((seen - expected)[enough] ** 2 / expected[enough]).sum())
        assert chi2 < enough.sum() + 4.5 * np.sqrt(2.0 * enough.sum())


def test_the_paper_law_of_simsense_is_read_back():
    """simsense draws its paper-d415 preset: the figures asked for are k and sigma to 3 %, black to 0.05 DN."""
    signal, (height, width), repeats = simsense.signal_preset("paper-d415"), _SIZE, 100
    camera = simsense.Camera(width, height, np.array([[200.0, 0, 32], [0, 200, 20], [0, 0, 1]]))
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    how = {"rectified": True, "max_disparity": 32, "batch_count": repeats, "noise_seed": 5}
    engine = simsense.Engine(simsense.Device("host"), camera, camera, left_to_right, **how)
    engine.set_signal(signal, signal)
    stack = np.repeat(clean_image(1)[None].astype(np.float32), repeats, 0)
    engine.set_parameters(frame_index=0)
    noise = calibrate_noise([Repeats("simsense", engine.compute(stack, stack, ("ir_left",))["ir_left"].copy())])
    assert noise.chosen == "gamma" and noise.margin_nats[0] > 5.0 * noise.margin_nats[1]
    noise_model = noise.fit.noise_model
    assert noise_model.shape == pytest.approx(3.98, rel=0.03)
    # Without dark frames its own error is 1.4 %.
    assert noise_model.sigma_dn == pytest.approx(0.83, rel=0.03 + 1.6 * noise.fit.error[1])
    assert noise_model.black_dn == pytest.approx(-0.231, abs=0.05 + 1.6 * noise.fit.error[2])
    assert noise.model().imager.relative.value == pytest.approx(1.0 / noise_model.shape)


@pytest.mark.parametrize("noise_model", [ShotModel(0.4, 0.7, 5.0), GammaModel(30.0, 0.7, 5.0)])
def test_with_dark_frames_the_asked_figures_hold(noise_model):
    noise = calibrate_noise(views(noise_model, 40), dark(noise_model), seed=1)
    assert noise.chosen == noise_model.name
    fit = noise.fit
    assert fit.noise_model.shape == pytest.approx(noise_model.shape, rel=0.03)
    assert fit.noise_model.sigma_dn == pytest.approx(noise_model.sigma_dn, rel=0.03)
    assert fit.noise_model.black_dn == pytest.approx(noise_model.black_dn, abs=0.05)
    for name in ("shape", "sigma_dn", "black_dn"):
        low, high = fit.interval(name)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        assert abs(getattr(noise_model, name) - middle) < 2.5 * half  # a 90 % interval, 4 standard errors


def test_clipped_counts_are_censored():
    """A quarter of the pixels lie where many counts clip at 255."""
    noise_model = GammaModel(10.0, 0.8, 5.0)
    noise = calibrate_noise(views(noise_model, 30, low=40.0, high=260.0), dark(noise_model))
    assert noise.clipped_share > 0.05
    assert noise.fit.noise_model.shape == pytest.approx(10.0, rel=0.03)


def test_exposures_tell_black_and_photon_transfer():
    noise_model, clean = ShotModel(0.4, 0.7, 6.0), clean_image(2, 4.0, 50.0)
    frames = [
        Repeats(f"exposure {t}", drawn(noise_model, t * clean, 30, 10 + t), 0.001 * t, "one view") for t in (1, 2, 4)
    ]
    noise = calibrate_noise(frames)
    assert noise.black_from == "the exposures' intercept"
    assert noise.fit.noise_model.black_dn == pytest.approx(6.0, abs=0.05)
    assert noise.chosen == "shot" and noise.fit.noise_model.shape == pytest.approx(0.4, rel=0.03)
    assert [p.exposure_gain for p in noise.transfer] == [0.001, 0.002, 0.004]
    first, _, last = noise.transfer
    slope = (last.variance_dn2 - first.variance_dn2) / (last.mean_dn - first.mean_dn)
    assert slope == pytest.approx(0.4, rel=0.03)


@pytest.fixture
def folder(tmp_path):
    """12 frames of a view as PNG files."""
    path = tmp_path / "view"
    path.mkdir()
    for i, image in enumerate(drawn(GammaModel(5.0, 0.8, 5.0), clean_image(3, size=(10, 16)), 12, 4)):
        write_gray(path / f"{i:03d}.png", image)
    return path


def test_the_command_replaces_one_section_only(folder, tmp_path, capsys):
    out = tmp_path / "model.json"
    before = {"format": "active-stereo-model", "version": 2, "kept": {"as": 1}, "nuisances": {"focal_left": 0.001}}
    out.write_text(json.dumps(before))
    assert main(["calibrate", "noise", str(folder), "-o", str(out), "--verbose"]) == 0
    text = " ".join(capsys.readouterr().out.split())  # lines break where the path's length has it
    assert all(words in text for words in ("noise model: gamma", "1/k: a gauge", "never show in repeats"))
    model = json.loads(out.read_text())
    assert model["kept"] == {"as": 1} and model["nuisances"]["focal_left"] == 0.001
    assert sorted(p.name for p in tmp_path.iterdir()) == ["model.json", "view"]


def test_the_sensor_takes_what_was_measured(tmp_path):
    """Through the file into the sensor's configuration: the noise model that was drawn from, read noise without
    rounding's."""
    noise_model = GammaModel(4.0, 0.8, 5.0)
    out = tmp_path / "model.json"
    replace_sections(out, calibrate_noise(views(noise_model, 20), dark(noise_model)).model())
    config = StereoDepthSensorConfig.from_model(read_model(out))
    assert config.ir_signal["speckle_shape"] == pytest.approx(4.0, rel=0.03)
    assert config.ir_signal["adc_noise_dn"] == pytest.approx(0.8, rel=0.03)
    assert config.ir_black_level_dn == pytest.approx(5.0, abs=0.05)


def test_bad_repeats_are_refused_in_one_line(folder, tmp_path, capsys):
    out, files = tmp_path / "model.json", [folder / f"{i:03d}.png" for i in range(12)]
    ask, model, clean = ["calibrate", "noise", folder, "-o", out], GammaModel(400.0, 0.5, 5.0), clean_image(3)
    for file in files[:3]:
        file.unlink()
    assert "9 repeats, at least 10" in refused(ask, capsys)
    for says, image in (
        ("the repeats move", lambda i: np.roll(drawn(model, clean, 1, i)[0], i // 6, axis=1)),  # by a pixel half way
        ("brightness drifts", lambda i: drawn(model, clean * (1 + 0.01 * i), 1, i)[0]),
        ("pixels clip", lambda i: drawn(model, 40 * clean_image(3, 6.0), 1, i)[0]),
    ):
        for i, file in enumerate(files):
            write_gray(file, image(i))
        assert says in refused(ask, capsys)
    write_gray(folder / "005.png", np.zeros((4, 4), np.uint8))
    assert "005.png: is 4x4" in refused(ask, capsys)
    (folder / "005.png").write_bytes(b"\x89PNG broken")
    assert "005.png" in refused(ask, capsys)
    assert "no folder" in refused(["calibrate", "noise", tmp_path / "nothing", "-o", out], capsys)
    assert not out.exists()
    out.write_text("{}")
    folder2 = tmp_path / "again"
    folder2.mkdir()
    for i, image in enumerate(drawn(GammaModel(5.0, 0.8, 5.0), clean_image(3, size=(10, 16)), 10, 4)):
        write_gray(folder2 / f"{i}.png", image)
    assert "give another file to -o" in refused(["calibrate", "noise", folder2, "-o", out], capsys)
    assert out.read_text() == "{}"
