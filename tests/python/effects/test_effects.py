# SPDX-License-Identifier: Apache-2.0
"""Effects: every built-in one obeys the laws, lawless ones are caught, and each does what its physics says."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from activestereo.effects import Light, Model, Parameter, Randomness, Stage, broken_laws, builtin, effect
from activestereo.effects.core.descriptor import Lever, StartImage
from activestereo.effects.core.laws import example_value, example_view
from activestereo.compare.nuisances import Nuisances, predict

EFFECTS = builtin()


@pytest.mark.parametrize("name", list(EFFECTS))
def test_every_builtin_effect_obeys_the_laws_and_says_its_source_and_units(name):
    e = EFFECTS[name]
    assert broken_laws(e) == []
    assert e.source and e.summary and e.family
    assert all(p.unit for p in e.parameters)


def make(function, **fields):
    parameters = [Parameter("a", "1", 0.0, 0.0, 1.0, 0.5)]
    function.__doc__ = "A test."
    given = {"stage": Stage.READOUT, "family": "test", "source": "test", "parameters": parameters}
    return effect("bad", **(given | fields))(function)


def same(image):
    """Light whose parts are all this image."""
    return Light.of_images([image] * 4)


def blob(view, u0, v0):
    u, v = view.pixels()
    return np.exp(-((u - u0) ** 2 + (v - v0) ** 2) / 8)


def middle(view, image):
    """(column, row) of an image's light."""
    return tuple((image * x).sum() / image.sum() for x in view.pixels())


@pytest.mark.parametrize(
    ("function", "fields", "word"),
    [
        (lambda s, view, a: s + 1, {}, "neutral"),
        (lambda s, view, a: s + a * np.random.default_rng().random(), {}, "another output"),
        (lambda s, view, a: s / (1 - a), {}, "not finite"),
        (lambda s, view, a: s, {}, "no influence"),
        (lambda s, view, a: s.__iadd__(a), {}, "in place"),
        (lambda s, view, a: s + a * view.rng("x").random(), {}, "seed"),
        (lambda s, view, a: s + a * view.rng("x").random(), {"randomness": Randomness.TEMPORAL}, "repeats"),
    ],
)
def test_a_lawless_effect_is_caught(function, fields, word):
    with np.errstate(all="ignore"):
        assert any(word in sentence for sentence in broken_laws(make(function, **fields)))


@pytest.mark.parametrize("is_right", [True, False])
def test_an_effect_of_one_camera_alone_is_lawful(is_right):
    assert broken_laws(make(lambda s, view, a: s + a * (view.is_right == is_right))) == []


def test_wrong_parameters_are_named():
    with pytest.raises(ValueError, match=r"vignetting has no parameter 'strength' \(known: exponent\)"):
        EFFECTS["vignetting"].values({"strength": 1})
    with pytest.raises(ValueError, match=r"vignetting.exponent is 99.0"):
        EFFECTS["vignetting"].values({"exponent": 99})
    with pytest.raises(ValueError, match="takes \\['b'\\], the parameters are \\['a'\\]"):
        make(lambda s, view, b: s)


@pytest.mark.parametrize("name", ["prnu", "shot_noise", "fixed_pattern_noise", "read_noise", "row_noise"])
def test_draws_have_the_variance_that_their_terms_say(name):
    e, view = EFFECTS[name], example_view()
    signal = np.full(view.shape, 90.0)
    draws = np.stack([e(signal, replace(view, seed=s), **e.typical_values) for s in range(60)])
    levers = {Lever.ONE: 1.0, Lever.SIGNAL: 90.0, Lever.PHOTONS: np.sqrt(view.frame.gain * 90.0)}
    sizes = [(e.typical_values[t.parameter], t.lever) for t in e.random_terms]
    predicted = sum((size if at is Lever.PHOTONS else size**2) * levers[at] ** 2 for size, at in sizes)
    assert draws.var(axis=0, ddof=1).mean() == pytest.approx(predicted, rel=0.05)
    assert draws.mean() == pytest.approx(90.0, abs=4 * np.sqrt(predicted / 60 / view.shape[0]))


def test_projector_effects_leave_ambient_light_alone():
    view = example_view()
    light = example_value(Stage.PROJECTOR, view)
    for e in EFFECTS.values():
        if e.stage is Stage.PROJECTOR:
            np.testing.assert_array_equal(e(light, view, **e.typical_values).ambient, light.ambient)


@pytest.mark.parametrize("sigma", [0.2, 0.5, 1.3])
def test_a_blur_keeps_energy_and_its_variance_is_its_sigma_squared_below_a_pixel_too(sigma):
    view, image = example_view(), np.zeros(example_view().shape)
    image[36, 48] = 1.0
    seen = EFFECTS["lens_psf"](same(image), view, sigma_px=sigma).direct
    assert seen.sum() == pytest.approx(1.0, rel=1e-6)
    assert (seen * (view.pixels()[0] - 48) ** 2).sum() == pytest.approx(sigma**2, rel=0.01)


def test_resampling_keeps_the_place_and_spreads_it_as_two_weighted_pixels_do():
    view = example_view()
    u, still = view.pixels()[0], blob(view, 48, 36)
    seen = EFFECTS["rectification_resampling"](same(still), view, phase_u_px=0.3, phase_v_px=0.0).direct
    column, row = middle(view, seen)
    assert (column, row) == (pytest.approx(48, abs=1e-3), pytest.approx(36, abs=1e-6))
    variance = (seen * (u - column) ** 2).sum() / seen.sum() - (still * (u - 48) ** 2).sum() / still.sum()
    assert variance == pytest.approx(0.3 * 0.7, rel=0.01)


def test_baseline_drift_shifts_by_focal_length_times_offset_over_depth():
    view = example_view()
    view = replace(view, depth_m=np.full(view.shape, 0.8))
    moved = EFFECTS["baseline_drift"](same(blob(view, 50, 30)), view, offset_m=0.004).ambient
    assert middle(view, moved)[0] == pytest.approx(50 - view.K[0, 0] * 0.004 / 0.8, abs=0.01)


@pytest.mark.parametrize(
    ("name", "values", "law"),
    [
        ("gain_error", {"exposure_offset_s": 1e-4, "log_gain": 0.1}, lambda s: s * (4.1 / 4) * 2**0.1),
        ("gain_mismatch", {"gain": 0.2, "offset_dn": -3.0}, lambda s: 1.1 * s - 1.5),
        ("dark_signal", {"rate_dn_per_s": 200.0, "doubling_k": 8.0}, lambda s: s + 200 * 0.008 * 2 ** (20 / 8)),
        ("black_level", {"offset_dn": -2.0, "per_k_dn": 0.1}, lambda s: s - 2.0 + 0.1 * 20),
        ("response_gamma", {"log_exponent": 0.3}, lambda s: 255 * (s / 255) ** np.exp(0.3)),
    ],
)
def test_the_imager_counts_by_emva_1288_s_formulas(name, values, law):
    """A right camera at 45 C, 4 ms and gain 2; nothing is rounded or bounded yet."""
    signal = np.linspace(0.5, 400.0, 72 * 96).reshape(72, 96)
    np.testing.assert_allclose(EFFECTS[name](signal, example_view(), **values), law(signal), rtol=2e-6, atol=2e-4)


def test_saturation_keeps_charge_that_spills_and_caps_the_rest():
    view = example_view()
    signal = np.full(view.shape, 10.0)
    signal[30, 40] = 250.0
    out = EFFECTS["saturation_blooming"](signal, view, lost_range=0.4, spill=1.0)
    assert out.max() == pytest.approx(0.6 * 255)
    assert out.sum() == pytest.approx(signal.sum())
    assert out[29, 40] == out[31, 40] > 10.0


def test_a_well_is_proposed_where_the_brightest_pixels_are():
    view = example_view()
    expected = np.linspace(0.0, 200.0, 72 * 96).reshape(view.shape)
    residual = np.minimum(expected, 102.0) - expected
    image = StartImage(view, None, np.ones(view.shape), residual, expected, 1.0, expected)
    full, *below = EFFECTS["saturation_blooming"].starts([image])
    assert full["lost_range"] == pytest.approx(1 - 102 / 255)
    assert all(full["lost_range"] < start["lost_range"] < 0.9 for start in below)


def test_a_model_without_effects_is_the_base_model_and_order_follows_the_light():
    view = example_view()
    layers = example_value(Stage.PROJECTOR, view)
    nuisances = Nuisances(3e4, 9e3, 4.0)

    class Rendered:
        projector, ambient = layers.projector, layers.ambient

    base = Model()
    expected = predict(view.frame, Rendered, nuisances, view.max_dn)
    np.testing.assert_allclose(base.signal(layers, view, nuisances), expected)
    one = base.with_effect(EFFECTS["response_gamma"], log_exponent=0.2).with_effect(EFFECTS["vignetting"], exponent=4)
    other = base.with_effect(EFFECTS["vignetting"], exponent=4).with_effect(EFFECTS["response_gamma"], log_exponent=0.2)
    images = [m.signal(m.light(layers, view), view, nuisances) for m in (one, other)]
    np.testing.assert_array_equal(*images)
    assert images[0][36, 48] != images[0][0, 0]


def test_the_expected_value_is_the_mean_of_exposures():
    view = example_view()
    layers = example_value(Stage.PROJECTOR, view)
    nuisances = Nuisances(3e4, 9e3, 4.0)
    model = Model()
    for name in ("speckle_temporal", "shot_noise", "read_noise"):
        model = model.with_effect(EFFECTS[name], **EFFECTS[name].typical_values)
    expected = model.signal(model.light(layers, view), view, nuisances)
    mean = np.zeros(view.shape)
    for seed in range(100):
        v = replace(view, seed=seed)
        mean += model.signal(model.light(layers, v, random=True), v, nuisances, random=True) / 100
    inside = expected < 200
    assert np.abs((mean - expected)[inside]).mean() < 0.5
    assert (mean - expected)[inside].mean() == pytest.approx(0.0, abs=0.05)


def test_noise_removes_the_mean_error_of_coarse_steps():
    view, step_dn, rng = example_view(), 8.0, np.random.default_rng(4)
    model = Model().with_effect(EFFECTS["quantisation"], step_dn=step_dn)
    clean = np.linspace(20.0, 60.0, view.shape[1]) * np.ones(view.shape)
    noisy = (clean + 0.5 * step_dn * rng.standard_normal(clean.shape) for _ in range(400))
    mean = np.mean([model.digital(value, view, 0.0, random=True).mean(axis=0) for value in noisy], axis=0)
    assert np.abs(mean - model.digital(clean, view, 0.0)[0]).max() < 0.1 * step_dn
    assert np.all(model.digital(clean, view, 0.0, random=True) % step_dn == 0.0)


def test_stages_of_python_are_those_of_c():
    header = (Path(__file__).resolve().parents[3] / "capi/include/ks/effect.h").read_text(encoding="utf-8")
    in_c = {name: int(value) for name, value in re.findall(r"#define KS_STAGE_(\w+) (\d+)u", header)}
    assert in_c == {stage.name: int(stage) for stage in Stage}
