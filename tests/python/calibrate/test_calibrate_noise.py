# SPDX-License-Identifier: Apache-2.0
"""Noise from repeats: drawn by NumPy and by simsense from noise models that are known, and read back."""

import json

import numpy as np
import pytest
import simsense

from activestereo import StereoDepthSensorConfig
from activestereo.calibrate.noise import NoiseModel, calibrate_noise
from activestereo.calibrate.repeats import Repeats
from activestereo.model.write import replace_sections
from activestereo.cli import main
from activestereo.capture.images import write_gray
from activestereo.model import read_model
from command_line import refused
from depth_engines import depth_engine

_SIZE = (40, 64)


def clean_image(seed: int, low: float = 0.4, high: float = 110.0, size: tuple[int, int] = _SIZE) -> np.ndarray:
    """Counts above black: levels spread over the range, in blocks."""
    rng = np.random.default_rng(seed)
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


def drawn(noise_model: NoiseModel, clean: np.ndarray, repeats: int, seed: int) -> np.ndarray:
    """Repeats by NumPy's own generators."""
    rng, shape, k = np.random.default_rng(seed), (repeats, *clean.shape), noise_model.shape
    is_gamma = noise_model.kind == "gamma"
    light = clean * rng.gamma(k, 1.0 / k, shape) if is_gamma else k * rng.poisson(clean / k, shape)
    counts = np.rint(light + noise_model.black_dn + rng.normal(0.0, noise_model.sigma_dn, shape))
    return counts.clip(0, 255).astype(np.uint8)


def views(noise_model: NoiseModel, repeats: int, seed: int = 0, **more: float) -> list[Repeats]:
    return [Repeats("view", drawn(noise_model, clean_image(seed, **more), repeats, seed + 1))]


def dark(noise_model: NoiseModel, seed: int = 7) -> list[Repeats]:
    return [Repeats("dark", drawn(noise_model, np.full(_SIZE, 1e-9), 12, seed))]


@pytest.mark.parametrize(
    "noise_model",
    [
        NoiseModel("gamma", 4.0, 0.8, 5.0), NoiseModel("gamma", 40.0, 0.5, -0.4), NoiseModel("shot", 0.3, 0.6, 5.0),
        NoiseModel("shot", 2.0, 0.4, 3.0),
    ],
)  # fmt: skip
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
    signal, repeats = simsense.signal_preset("paper-d415"), 100
    engine = depth_engine(_SIZE[::-1], 200, max_disparity=32, batch_count=repeats, noise_seed=5)
    engine.set_signal(signal, signal)
    stack = np.repeat(clean_image(1)[None].astype(np.float32), repeats, 0)
    engine.set_parameters(frame_index=0)
    noise = calibrate_noise([Repeats("simsense", engine.compute(stack, stack, ("ir_left",))["ir_left"].copy())])
    assert noise.chosen == "gamma" and noise.margin_nats[0] > 5.0 * noise.margin_nats[1]
    noise_model = noise.noise_model
    assert noise_model.shape == pytest.approx(3.98, rel=0.03)
    # Without dark frames its own error is 1.4 %.
    assert noise_model.sigma_dn == pytest.approx(0.83, rel=0.03 + 1.6 * noise.error[1])
    assert noise_model.black_dn == pytest.approx(-0.231, abs=0.05 + 1.6 * noise.error[2])
    assert noise.model().imager.relative.value == pytest.approx(1.0 / noise_model.shape)


@pytest.mark.parametrize("noise_model", [NoiseModel("shot", 0.4, 0.7, 5.0), NoiseModel("gamma", 30.0, 0.7, 5.0)])
def test_with_dark_frames_the_asked_figures_hold(noise_model):
    noise = calibrate_noise(views(noise_model, 40), dark(noise_model), seed=1)
    assert noise.chosen == noise_model.kind
    assert noise.noise_model.shape == pytest.approx(noise_model.shape, rel=0.03)
    assert noise.noise_model.sigma_dn == pytest.approx(noise_model.sigma_dn, rel=0.03)
    assert noise.noise_model.black_dn == pytest.approx(noise_model.black_dn, abs=0.05)
    for name in ("shape", "sigma_dn", "black_dn"):
        _, low, high = noise.interval(name)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        assert abs(getattr(noise_model, name) - middle) < 2.5 * half  # a 90 % interval, 4 standard errors


def test_clipped_counts_are_censored():
    """A quarter of the pixels lie where many counts clip at 255."""
    noise_model = NoiseModel("gamma", 10.0, 0.8, 5.0)
    noise = calibrate_noise(views(noise_model, 30, low=40.0, high=260.0), dark(noise_model))
    assert noise.clipped_share > 0.05
    assert noise.noise_model.shape == pytest.approx(10.0, rel=0.03)


def test_exposures_tell_black_and_photon_transfer():
    noise_model, clean = NoiseModel("shot", 0.4, 0.7, 6.0), clean_image(2, 4.0, 50.0)
    seen = {t: drawn(noise_model, t * clean, 30, 10 + t) for t in (1, 2, 4)}
    noise = calibrate_noise([Repeats(f"exposure {t}", own, 0.001 * t, "one view") for t, own in seen.items()])
    assert noise.black_from == "the exposures' intercept"
    assert noise.noise_model.black_dn == pytest.approx(6.0, abs=0.05)
    assert noise.chosen == "shot" and noise.noise_model.shape == pytest.approx(0.4, rel=0.03)
    exposures, means, variances = np.transpose(noise.transfer)
    assert list(exposures) == [0.001, 0.002, 0.004]
    assert np.polyfit(means, variances, 1)[0] == pytest.approx(0.4, rel=0.03)


GAIN, SIGMA, BLACK, DSNU = 1.0, 3.0, 29.4, 1.5


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    """Pairs of even frames of a 12-bit camera in a folder each, dark ones, and EMVA 1288's descriptor of them."""
    folder, rng, size = tmp_path_factory.mktemp("steps"), np.random.default_rng(8), (64, 96)
    uneven, offset = 1.0 + 0.02 * rng.standard_normal(size), BLACK + DSNU * rng.standard_normal(size)
    lines = ["# drawn", "v 3.1", "n 12 96 64"]
    for place, electrons in enumerate((*np.linspace(2e2, 3.8e3, 12), 0.0)):
        own = folder / (f"lit/{place:02d}" if electrons else "dark")
        own.mkdir(parents=True)
        lines.append(f"b 1000000.0 {2 * electrons:.1f}" if electrons else "d 1000000.0")
        for number in range(2):
            dn = GAIN * rng.poisson(electrons * uneven) + rng.normal(0.0, SIGMA, size) + offset
            write_gray(own / f"{number}.png", np.rint(dn).clip(0, 4095).astype(np.uint16))
            lines.append(f"i {own.relative_to(folder)}/{number}.png".replace("/", "\\"))
    (folder / "EMVA1288_Data.txt").write_text("\n".join(lines) + "\n")
    return folder


@pytest.mark.parametrize("words", [["EMVA1288_Data.txt"], ["lit", "--dark", "dark"]])
def test_pairs_at_steps_of_light_tell_gain_and_dark_noise(words, steps, tmp_path, capsys):
    out, words = tmp_path / "model.json", [word if word == "--dark" else str(steps / word) for word in words]
    assert main(["calibrate", "noise", *words, "-o", str(out), "--verbose"]) == 0
    model, text = read_model(out), capsys.readouterr().out
    assert model.imager.shot.value == pytest.approx(GAIN, rel=0.03) and model.imager.relative.value == 0.0
    assert np.sqrt(model.imager.offset.value - 1.0 / 12.0) == pytest.approx(SIGMA, rel=0.03)
    assert model.nuisances["black_dn"].value == pytest.approx(BLACK, abs=0.15)
    for truth, q in ((GAIN, model.imager.shot), (SIGMA**2 + 1.0 / 12.0, model.imager.offset)):
        assert abs(truth - 0.5 * (q.low + q.high)) < 1.25 * (q.high - q.low)  # a 90 % interval, 4 standard errors
    assert float(text.split("DSNU")[1].split()[0]) == pytest.approx(DSNU, rel=0.15)


@pytest.mark.parametrize(
    "old, new, says",
    [
        ("d 1000000.0", "# d", "or no dark frames: cover the lens"),
        ("v 3.1", "what is this", ":2: is 'what is this', expected a line"),
        ("i lit\\00\\1.png", "", ":4: has 1 of two frames"),
        ("i lit\\00\\1.png", "i none.png", "none.png"),
        ("i lit\\00\\1.png", "i /dev/null", ":6: /dev/null lies outside of"),
        ("i lit\\00\\1.png", "i small.png", "small.png: is 4x4 uint16, 0.png is 96x64 uint16"),
    ],
)
def test_bad_descriptors_are_refused_in_one_line(old, new, says, steps, tmp_path, capsys):
    path = steps / "bad.txt"
    write_gray(steps / "small.png", np.zeros((4, 4), np.uint16))
    path.write_text((steps / "EMVA1288_Data.txt").read_text().replace(old, new, 1))
    assert says in refused(["calibrate", "noise", path, "-o", tmp_path / "model.json"], capsys)


def test_one_step_of_light_is_refused(steps, tmp_path, capsys):
    path = steps / "one.txt"
    path.write_text("b 1 1\ni lit/00/0.png\ni lit/00/1.png\nd 1\ni dark/0.png\ni dark/1.png\n")
    assert "no step of light lies below" in refused(["calibrate", "noise", path, "-o", tmp_path / "m.json"], capsys)


@pytest.fixture
def folder(tmp_path):
    """12 frames of a view as PNG files."""
    return write_view(tmp_path / "view")


def write_view(path):
    path.mkdir()
    for i, image in enumerate(drawn(NoiseModel("gamma", 5.0, 0.8, 5.0), clean_image(3, size=(10, 16)), 12, 4)):
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
    """The noise model that was drawn from arrives in the sensor's configuration, without rounding's read noise."""
    noise_model = NoiseModel("gamma", 4.0, 0.8, 5.0)
    out = tmp_path / "model.json"
    replace_sections(out, calibrate_noise(views(noise_model, 20), dark(noise_model)).model())
    config = StereoDepthSensorConfig.from_model(read_model(out))
    assert config.ir_signal["speckle_shape"] == pytest.approx(4.0, rel=0.03)
    assert config.ir_signal["adc_noise_dn"] == pytest.approx(0.8, rel=0.03)
    assert config.ir_black_level_dn == pytest.approx(5.0, abs=0.05)


def test_bad_repeats_are_refused_in_one_line(folder, tmp_path, capsys):
    out, files = tmp_path / "model.json", [folder / f"{i:03d}.png" for i in range(12)]
    ask, model, clean = ["calibrate", "noise", folder, "-o", out], NoiseModel("gamma", 400.0, 0.5, 5.0), clean_image(3)
    for file in files[:3]:
        file.unlink()
    assert "9 repeats in " in refused(ask, capsys)
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
    again = write_view(tmp_path / "again")
    assert "give another file to -o" in refused(["calibrate", "noise", again, "-o", out], capsys)
    assert out.read_text() == "{}"
    out.write_text('{"format": "active-stereo-model", "version": 2, "nuisances": []}')
    assert "nuisances: is not an object" in refused(["calibrate", "noise", tmp_path / "nothing", "-o", out], capsys)
    out.unlink()
    dark = tmp_path / "dark.npy"
    for size, says in (((4, 6), "have 6x4 pixels, the lit ones 16x10"), ((0, 0), "is uint8 (12, 0, 0), expected")):
        np.save(dark, np.zeros((12, *size), np.uint8))
        assert says in refused(["calibrate", "noise", again, "--dark", dark, "-o", out], capsys)
