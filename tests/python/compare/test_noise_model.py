# SPDX-License-Identifier: Apache-2.0
"""Noise of a camera, of the renderer and of unsteady light."""

from dataclasses import dataclass, fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from activestereo.capture.capture import read_capture
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from activestereo.compare.image_errors import ImageErrors
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.noise import by_repeats, comb_of, fit_noise_model, unsteady_light
from activestereo.compare.render import BaseRenders, mean_of_halves, noise_square
from activestereo.diagnose import diagnose
from activestereo.effects import builtin
from lab_worlds import RememberingRenderer, WorldRenderer

BLACK_DN, READ_DN, SPECKLE = 4.0, 1.0, 0.13


def tone(dn):
    return BLACK_DN + 255.0 * (np.maximum(dn - BLACK_DN, 0.0) / 255.0) ** 0.9


def statistics_of(first, second):
    """Mean and variance of two exposures of one frame."""
    return [([SimpleNamespace(gain=1.0)] * 2, "left", (first + second) / 2, (first - second) ** 2 / 2)]


@pytest.fixture(scope="module")
def model_and_images():
    rng = np.random.default_rng(2)
    signal = rng.gamma(0.6, 14.0, (240, 400)) + 2.0

    def exposed():
        speckled = signal * (1.0 + SPECKLE * rng.standard_normal(signal.shape))
        value = BLACK_DN + speckled + READ_DN * rng.standard_normal(signal.shape)
        return np.clip(np.rint(tone(np.rint(value))), 0, 255)

    statistics = statistics_of(exposed(), exposed())
    return fit_noise_model(statistics, BLACK_DN, 255), tone(BLACK_DN + signal), statistics[0][-1]


def test_missing_numbers_do_not_make_the_noise_look_smaller(model_and_images):
    noise_model, expected, variance = model_and_images
    for low, high in ((5, 9), (9, 14), (14, 30), (30, 80)):
        here = (expected >= low) & (expected < high)
        assert noise_model.variance(expected[here]).mean() == pytest.approx(variance[here].mean(), rel=0.15)


@pytest.mark.parametrize("step, noise", [(11.0, 0.5), (11.0, 3.0), (4.0, 8.0)])
def test_the_noise_of_coarse_steps_holds_all_of_their_rounding(step, noise):
    """Two roundings of one value agree where steps are wider than the noise; their error does not vanish."""
    rng = np.random.default_rng(5)
    value = rng.uniform(60.0, 180.0, (200, 300))
    first, second = (step * np.rint((value + noise * rng.standard_normal(value.shape)) / step) for _ in range(2))
    model = fit_noise_model(statistics_of(first, second), 0.0, 255, comb_of([first, second], 255).step_dn)
    assert model.variance(value).mean() == pytest.approx(noise**2 + ROUNDING_VARIANCE * step**2, rel=0.05)


@pytest.mark.parametrize("step", [7.224, 11.09, 20.7])
def test_coarse_steps_do_not_pass_for_photons(step):
    """Photons' noise grows with the gain, rounding's does not: repeats at one gain have to tell them apart."""
    rng = np.random.default_rng(0)
    light = rng.gamma(1.2, 14.0, (240, 424)) + 1.0
    sigma = np.hypot(1.0, 0.12 * light)
    pair = [np.maximum(light + sigma * rng.standard_normal(light.shape), 0.0) for _ in range(2)]
    first, second = (np.clip(np.rint(step * (np.floor(image / step) + 0.5)), 0, 255) for image in pair)
    model = fit_noise_model(statistics_of(first, second), 8.0, 255, step)
    truth = (sigma**2 + ROUNDING_VARIANCE * step**2).mean()
    assert 0.9 * truth < model.variance(light, gain=8.0).mean() < 1.6 * truth


def test_the_mean_error_of_rounding_is_what_many_exposures_show():
    rng, step, noise = np.random.default_rng(6), 11.0, 2.0
    value = np.linspace(12.0, 200.0, 400)
    rounded = step * np.rint((value + noise * rng.standard_normal((4000, 400))) / step)
    comb = comb_of([rounded], 255)
    assert comb.step_dn == pytest.approx(step, rel=0.03)
    said = comb.mean_error(value, np.full(400, noise**2 + ROUNDING_VARIANCE * step**2))
    assert said == pytest.approx(rounded.mean(axis=0) - value, abs=0.3)
    assert comb_of([rng.integers(0, 200, (50, 50))], 255) is None


@pytest.mark.parametrize("step", np.geomspace(1.7, 22.0, 24).round(4))
@pytest.mark.parametrize("phase", [0.0, 0.37, 0.5])
@pytest.mark.parametrize("shape", [1.0, 2.0])  # of the light's distribution: in 1.0, four levels hold nearly all pixels
def test_coarse_steps_of_any_width_and_offset_are_found(step, phase, shape):
    light = np.random.default_rng(7).gamma(shape, 15.0, 60_000) + 5.0
    image = np.clip(np.rint(step * (np.floor(light / step) + phase)), 0, 255)
    comb = comb_of([image], 255)
    assert comb.limits_dn[0] <= step <= comb.limits_dn[1] and comb.step_dn == pytest.approx(step, rel=0.02)
    assert np.setdiff1d(image, [0, 255]).tolist() == comb.levels.tolist()


# Of one sample, relative. Much more of it and the fitted scales would be too small: noisy regressors attenuate.
NOISE = 0.15


class NoisyRenderer:
    """A clean renderer's layers with relative noise that falls with the number of samples, drawn from the request's
    seed."""

    def __init__(self, clean, noise_of_one_sample):
        self._clean, self._noise = clean, noise_of_one_sample
        self.version = f"noisy {noise_of_one_sample}"

    def __call__(self, request, progress=None):
        pose = int(abs(1e6 * request.cameras[0].camera_to_world[:3].sum()))
        rng = np.random.default_rng([request.seed, pose, request.samples_per_pixel])
        deviation = self._noise / np.sqrt(request.samples_per_pixel)
        return tuple(self._noisy(layers, rng, deviation) for layers in self._clean(request))

    def _noisy(self, layers, rng, deviation):
        shape = layers.ambient.shape
        factors = {name: 1 + deviation * rng.standard_normal(shape) for name in ("direct", "indirect", "ambient")}
        return replace(layers, **{name: (getattr(layers, name) * f).astype(np.float32) for name, f in factors.items()})


@pytest.fixture(scope="module")
def clean(lab_world):
    return RememberingRenderer(WorldRenderer(lab_world))


def test_an_estimate_from_halves_has_no_bias():
    rng = np.random.default_rng(1)
    truth, measured = 20.0, 20.0 + 2.0 + rng.standard_normal(200_000)
    first, second = (truth + 3.0 * rng.standard_normal(measured.shape) for _ in range(2))
    mean = 0.5 * (first + second)
    squares, noise = ((mean - measured) ** 2).sum(), noise_square(first, second) * measured.size
    assert np.sqrt(squares / measured.size) > 1.3 * np.sqrt(5.0)
    assert np.sqrt((squares - noise) / measured.size) == pytest.approx(np.sqrt(5.0), rel=0.01)
    assert squares - noise == pytest.approx(((first - measured) * (second - measured)).sum())


def test_errors_of_both_commands_do_not_grow_with_the_renderers_noise(lab_world, clean, tmp_path):
    effects = {"vignetting": builtin()["vignetting"]}

    def errors(noise):
        how = {"renderer": NoisyRenderer(clean, noise), "samples_per_pixel": 4, "cache": LayerCache(tmp_path)}
        diagnosed = diagnose(lab_world.capture_path, effects=effects, workers=1, **how).result
        return compare(lab_world.capture_path, **how).scores["ir"]["test"], diagnosed["heldout_ir_rmse_before"]

    (quiet, quiet_dn), (noisy, noisy_dn) = errors(0.0), errors(NOISE)
    assert quiet["render_noise_dn"] == 0.0
    assert np.hypot(noisy["rmse_dn"], noisy["render_noise_dn"]) > 1.04 * quiet["rmse_dn"]  # if it were not left out
    assert noisy["rmse_dn"] == pytest.approx(quiet["rmse_dn"], rel=0.015)
    assert noisy_dn == pytest.approx(quiet_dn, rel=0.015)


def test_halves_are_independent_and_their_mean_is_of_all_samples(lab_world, clean, tmp_path):
    capture, renderer = read_capture(lab_world.capture_path), NoisyRenderer(clean, NOISE)
    halves = BaseRenders(renderer, 4, cache=LayerCache(tmp_path)).halves(capture, capture.frames)
    mean, key = mean_of_halves(halves), (capture.frames[0].id, "left")
    first, second = (half[key[0]][key[1]] for half in halves)
    seen = first.ambient > 0
    noise = [(half.ambient - mean[key[0]][key[1]].ambient)[seen] for half in (first, second)]
    np.testing.assert_allclose(noise[0], -noise[1], atol=1e-5)
    assert (first.ambient != second.ambient)[seen].mean() > 0.99
    supersampled = mean[key[0]][key[1]].supersampled
    np.testing.assert_allclose(supersampled.pixels()[2], mean[key[0]][key[1]].ambient, rtol=1e-4, atol=1e-6)


def test_squares_of_blocks_are_free_of_the_renderer_s_noise():
    """An error of 2 DN everywhere, under renders that deviate by 5 DN: of pixels and of means over 3 x 3 of them."""
    rng, key = np.random.default_rng(4), (0, "left")
    first, second = 100.0 + 5.0 * rng.standard_normal((2, 300, 420))
    measured = np.full(first.shape, 102.0)
    known = dict.fromkeys((f.name for f in fields(ImageErrors)))
    images = {
        "measured": measured,
        "predictions": (first + second) / 2,
        "squares": (measured - first) * (measured - second),
    }
    errors = ImageErrors(**known | {name: {key: image} for name, image in images.items()})
    for size in (1, 3):
        squares = errors.squares_of_blocks(key, size)
        assert squares.shape == (300 // size, 420 // size) and squares.mean() == pytest.approx(4.0, abs=0.25)


HEIGHT, WIDTH = 120, 160
NOISE_DN = 1.5


@dataclass(frozen=True)
class _Light:
    projector: np.ndarray
    ambient: np.ndarray


def _light() -> _Light:
    u, v = np.meshgrid(np.arange(WIDTH) / WIDTH, np.arange(HEIGHT) / HEIGHT)
    return _Light(np.zeros((HEIGHT, WIDTH)), 1.0 + 0.6 * np.sin(9 * u) * np.cos(7 * v))


def _shots(change_by_row: list[np.ndarray]) -> list[MeasuredImage]:
    """Repeats of one view, whose mean is 20 DN of ambient light; change_by_row: DN [height][width] added to each."""
    rng, light = np.random.default_rng(7), _light()
    shots: list[Any] = []
    for k, change in enumerate(change_by_row):
        frame = SimpleNamespace(id=k, repeat_group=0, exposure_gain=1.0, ambient=None, projector_power=1.0)
        noise = NOISE_DN * rng.standard_normal((HEIGHT, WIDTH))
        shots.append(MeasuredImage(frame, "left", None, light, 20.0 * light.ambient + change + noise))
    return shots


def _variance(shots: list[MeasuredImage], taken_out: dict[Any, np.ndarray]) -> float:
    images = [shot.measured - taken_out.get(shot.key, 0.0) for shot in shots]
    return float(np.var(images, axis=0, ddof=1).mean())


@pytest.mark.parametrize(("frequency_hz", "line_time_s"), [(100.0, 2.6e-5), (230.0, 1.3e-5)])
def test_what_a_flickering_lamp_changes_is_taken_out_of_repeats(frequency_hz: float, line_time_s: float) -> None:
    time_s = np.arange(HEIGHT)[:, None] * line_time_s + np.array([0.0, 0.0334])
    factor = 0.4 * np.sin(2 * np.pi * frequency_hz * time_s)
    shots = _shots([20.0 * factor[:, k, None] * _light().ambient for k in range(2)])
    assert _variance(shots, {}) > 2.0 * NOISE_DN**2
    assert _variance(shots, unsteady_light(shots)) == pytest.approx(NOISE_DN**2, rel=0.03)


def test_noise_of_rows_and_of_pixels_stays() -> None:
    rng = np.random.default_rng(3)
    rows = [np.repeat(1.5 * rng.standard_normal((HEIGHT, 1)), WIDTH, axis=1) for _ in range(2)]
    assert unsteady_light(_shots(rows)) == {}
    assert unsteady_light(_shots([np.zeros((HEIGHT, WIDTH))] * 2)) == {}
    # A level that drifts in the dark is no lamp.
    assert unsteady_light(_shots([np.full((HEIGHT, WIDTH), level) for level in (0.0, 4.0)])) == {}


def test_frames_that_are_no_repeats_have_no_change() -> None:
    [shot] = _shots([np.zeros((HEIGHT, WIDTH))])
    shot.frame.repeat_group = None
    assert unsteady_light([shot]) == {}


def test_frames_that_are_alone_in_their_group_are_no_repeats() -> None:
    """Nor are those of another exposure: their gain has no repeats."""
    frame = dict(repeat_group=0, projector_power=1.0)
    frames = [SimpleNamespace(id=k, exposure_gain=gain, **frame) for k, gain in enumerate((1.0, 1.001, 8.0))]
    assert by_repeats((f, "left", f.id) for f in frames) == [[0, 1]]
