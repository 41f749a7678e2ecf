# SPDX-License-Identifier: Apache-2.0
"""Errors of images are without the renderer's own noise: a noisier render gives the same figures, not larger ones."""

from dataclasses import replace

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.effects import builtin
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from activestereo.diagnose import diagnose
from activestereo.compare.render import mean_of_halves, noise_square, render_halves
from lab_worlds import RememberingRenderer, WorldRenderer

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


def test_compares_error_does_not_grow_with_the_renderers_noise(lab_world, clean, tmp_path):
    def errors(noise):
        renderer, cache = NoisyRenderer(clean, noise), LayerCache(tmp_path)
        scores = compare(lab_world.capture_path, renderer=renderer, samples_per_pixel=4, cache=cache).scores
        return scores["ir"]["test"]

    quiet, noisy = errors(0.0), errors(NOISE)
    assert quiet["render_noise_dn"] == 0.0
    assert np.hypot(noisy["rmse_dn"], noisy["render_noise_dn"]) > 1.04 * quiet["rmse_dn"]  # if it were not left out
    assert noisy["rmse_dn"] == pytest.approx(quiet["rmse_dn"], rel=0.015)


def test_the_diagnosis_error_does_not_grow_with_the_renderers_noise(lab_world, clean, tmp_path):
    def error(noise):
        effects, renderer = {"vignetting": builtin()["vignetting"]}, NoisyRenderer(clean, noise)
        result = diagnose(
            lab_world.capture_path,
            effects=effects,
            renderer=renderer,
            samples_per_pixel=4,
            cache=LayerCache(tmp_path),
            workers=1,
        ).result
        return result["heldout_ir_rmse_before"]

    assert error(NOISE) == pytest.approx(error(0.0), rel=0.015)


def test_halves_are_independent_and_their_mean_is_of_all_samples(lab_world, clean, tmp_path):
    capture, renderer = read_capture(lab_world.capture_path), NoisyRenderer(clean, NOISE)
    halves = render_halves(capture, renderer, 4, cache=LayerCache(tmp_path), scale=2)
    mean, key = mean_of_halves(halves), (capture.frames[0].id, "left")
    first, second = (half[key[0]][key[1]] for half in halves)
    seen = first.ambient > 0
    noise = [(half.ambient - mean[key[0]][key[1]].ambient)[seen] for half in (first, second)]
    np.testing.assert_allclose(noise[0], -noise[1], atol=1e-5)
    assert (first.ambient != second.ambient)[seen].mean() > 0.99
    supersampled = mean[key[0]][key[1]].supersampled
    np.testing.assert_allclose(supersampled.pixels()[2], mean[key[0]][key[1]].ambient, rtol=1e-4, atol=1e-6)
