# SPDX-License-Identifier: Apache-2.0
"""The part of a named effect that a formula misses is no other effect's gain; rendered images and free curves stand for
formulas."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from activestereo.capture.capture import read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import render_frames
from activestereo.diagnose import refit
from activestereo.diagnose.dictionary import atoms_of, columns_of
from activestereo.diagnose.fitter import Fitter, ParameterSpace
from activestereo.diagnose.gather import gather
from activestereo.diagnose.linear import linearised
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.outcome import Name
from activestereo.diagnose.refit import fitted_to_renders, missed_share, refit_at_peaks, refit_free_curve
from activestereo.diagnose.search import Search
from activestereo.diagnose.selection import freed, gain_beyond, other_law, stand_ins
from activestereo.effects import Light, Model, Parameter, Stage, builtin, effect
from activestereo.effects.core.view import Layers
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world

TRUTH = 0.8
CURVATURE = 8.0
AMOUNT = Parameter("amount", "1", neutral=0.0, low=0.0, high=0.5, typical=0.1)
own = partial(effect, stage=Stage.OPTICS, family="f", source="s", parameters=[AMOUNT])


@own("dark_corners")
def dark_corners(image, view, amount):
    """The corners alone are darker."""
    u, v = view.field()
    return image * (1.0 - amount * ((u**2 + v**2) / 2) ** 2)


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """A world without noise."""
    folder = tmp_path_factory.mktemp("world")
    world = make_world(folder, grid=4)
    capture = read_capture(world.capture_path)
    return gather(capture, render_frames(capture, WorldRenderer(world), cache=LayerCache(folder / "cache")))


@own("haloes")
def haloes(image, view, amount):
    """Bright places shine on what is near them."""
    return image + amount * (near(image) - image.mean())


def near(image):
    return gaussian_filter(image, 0.12 * image.shape[1], mode="nearest")


def corners(image, view, falloff, gain):
    """Falls off to its corners by 1 - 0.3 (r^2 + falloff r^4); a right camera has another gain."""
    u, v = view.field()
    square = (u**2 + v**2) / 2
    return image * (1.0 - 0.3 * (square + falloff * square**2)) * (1.0 + gain * view.is_right)


def fading_glare(image, view):
    return 0.7 * image + 0.15 * (image.mean() + near(image))


def fit(evidence, space, steps, start=lambda space: space.start):
    """(the fitter, its fit from start(space))."""
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    return fitter, fitter.refine(space, np.array(start(space)), fitter.phi0(evidence.nuisances), steps)


def seen(clean, bent):
    """The evidence where images are bent(image, view), DN above black."""

    def exposed(o):
        dn = Model().signal(Light.of(o.layers), o.view, clean.nuisances) - clean.nuisances.black_dn
        return replace(o, measured=(bent(dn, o.view) + clean.nuisances.black_dn).astype("float32"))

    return replace(clean, train=tuple(map(exposed, clean.train)))


@pytest.mark.parametrize(
    "bent, first, second, low, high",
    [
        (partial(corners, falloff=0.6, gain=0.0), builtin()["vignetting"], dark_corners, 0.0, 0.3),
        (partial(corners, falloff=0.0, gain=0.1), builtin()["vignetting"], builtin()["gain_mismatch"], 0.7, 1.1),
        (fading_glare, builtin()["veiling_glare"], haloes, 0.0, 0.3),
    ],
    ids=["the formula's own error", "another effect", "glare that fades with distance"],
)
def test_a_further_name_explains_what_the_formula_of_the_first_cannot_look_like(clean, bent, first, second, low, high):
    evidence = seen(clean, bent)
    fitter, named = fit(evidence, ParameterSpace.of(Model(), first), 6, lambda space: space.start + 0.3)
    space = ParameterSpace.of(named.model, second)
    start = space.start.copy()
    start[len(named.theta)] += 0.05
    both = fitter.refine(space, start, named.phi, 6)
    beyond = gain_beyond(freed(linearised(fitter, named), [first], 0.035), both)
    assert low <= beyond / (named.sums.total - both.sums.total) <= high


def test_fits_that_are_all_worse_than_none_take_more_steps(clean, monkeypatch):
    """A lamp saturates images at its starts, where slopes tell nothing of how far to go."""
    vignetting = builtin()["vignetting"]
    fitter, base = fit(seen(clean, partial(corners, falloff=0.0, gain=0.0)), ParameterSpace.of(Model()), 4)
    far = partial(fitter.refine, theta=np.full(len(vignetting.parameters), 0.9), phi=base.phi, iterations=0)
    monkeypatch.setattr(refit, "_from_starts", lambda fitter, space, *_: far(space))
    chosen = [SimpleNamespace(id="vignetting", best=SimpleNamespace(atom=SimpleNamespace(effect=vignetting)))]
    assert far(ParameterSpace.of(Model(), vignetting)).sums.total > base.sums.total
    found = refit.refits(fitter, fitter, base, chosen, None)
    assert found["vignetting"].chi2 < 0.5 * base.sums.total


@pytest.mark.parametrize(("noise", "steps"), [(100.0, [6, 0]), (40.0, [6, 6])])
def test_a_rival_takes_no_more_steps_beside_a_fit_that_leaves_noise_alone(monkeypatch, noise, steps):
    """Both fits leave some of 1000 on few images, 110 and 300 of it."""
    chi2 = {"vignetting": 110.0, "veiling_glare": 300.0}
    model = Model().with_effect
    fits = {
        id: SimpleNamespace(sums=SimpleNamespace(total=c), theta=id, phi=None, model=model(builtin()[id]))
        for id, c in chi2.items()
    }
    monkeypatch.setattr(refit, "_from_starts", lambda fitter, space, *_: fits[space.pairs[-1][0].id])
    few = SimpleNamespace(nuisance_fit=lambda *_: (None, 1000.0), pixels_used=lambda: noise, memory=None)
    taken = []
    every = SimpleNamespace(memory=None, refine=lambda _, id, __, steps, ___: taken.append(steps) or fits[id])
    chosen = [SimpleNamespace(id=id, best=SimpleNamespace(atom=SimpleNamespace(effect=builtin()[id]))) for id in chi2]
    near = SimpleNamespace(model=Model(), phi=None, sums=SimpleNamespace(total=1000.0))
    refit.refits(every, few, near, chosen, None)
    assert taken == steps


def test_an_amplitude_that_acts_by_its_square_does_not_hold_a_fit_up(clean):
    """A blur has no slope at neutral. A step as far as such a slope foretells would spoil the other amplitude's."""
    evidence = seen(clean, lambda image, view: gaussian_filter(image, 0.5, mode="nearest"))
    _, found = fit(evidence, ParameterSpace.of(Model(), builtin()["lens_psf"]), 2, lambda space: [0.1, 0.0])
    assert found.theta == pytest.approx([0.5, 0.0], abs=0.05)


def warm_charge(image, view):
    """Dark current that doubles faster than usual."""
    return image + 400.0 * view.frame.exposure_s * view.frame.gain * 2.0 ** (view.warming_k / 5.0)


def of_others(linear, name, others, floor):
    atoms = atoms_of(linear, [builtin()[other] for other in others], NUMBERS.prior_reach)
    return stand_ins(linear, builtin()[name], atoms, columns_of(linear, atoms), floor, NUMBERS)


@pytest.mark.parametrize(
    "name, bent, frames, start, steps, twin, other",
    [
        ("dark_signal", warm_charge, {0: {"temperature_c": 45.0}, 2: {"exposure_s": 0.002}}, [300.0, 6.0], 8,
         "black_level", "gain_mismatch"),
        ("chromatic_drift", None, {0: {"temperature_c": 45.0}, 2: {"temperature_c": 35.0}}, [-0.02, 0.02], 0,
         "laser_power_drift", "gain_error"),
    ],
    ids=["a shape", "a part"],
)  # fmt: skip
def test_what_may_stand_for_a_part_of_a_name_is_told(clean, name, bent, frames, start, steps, twin, other):
    taken = [replace(o.frame, **frames.get(o.frame.id, {})) for o in clean.train]
    train = (replace(o, frame=f, view=replace(o.view, frame=f)) for o, f in zip(clean.train, taken, strict=True))
    evidence = replace(clean, train=tuple(train))
    evidence = seen(evidence, bent) if bent else evidence
    fitter, named = fit(evidence, ParameterSpace.of(Model(), builtin()[name]), steps, lambda space: start)
    assert of_others(linearised(fitter, named), name, (twin, other, "lens_psf"), 1e-3) == [twin]


@pytest.mark.parametrize("cold_dn, is_of_another_law", [(0.0, False), (2.0, True)])
def test_a_drift_that_cold_frames_show_too_follows_another_law(clean, cold_dn, is_of_another_law):
    """The black level of the warm frame is 6 DN higher, and that of every other cold one `cold_dn`."""

    def risen(image, view):
        return image + (6.0 if view.warming_k else cold_dn * (view.frame.id % 2))

    frames = [replace(o.frame, temperature_c=45.0 if o.frame.id == 0 else 25.0) for o in clean.train]
    train = (replace(o, frame=f, view=replace(o.view, frame=f)) for o, f in zip(clean.train, frames, strict=True))
    evidence, space = replace(clean, train=tuple(train)), ParameterSpace.of(Model(), builtin()["black_level"])
    fitter, named = fit(seen(evidence, risen), space, 6, lambda space: [0.0, 0.1])
    without = fitter.refine(ParameterSpace.of(Model()), np.zeros(0), named.phi, 6)
    missed = 0.07 * (without.sums.total - named.sums.total) / fitter.pixels_used()
    assert (other_law(linearised(fitter, named), {"black_level": missed}) > 1.0) == is_of_another_law


def test_a_shape_is_looked_at_within_its_range(clean):
    subsurface = builtin()["subsurface"]
    theta = [{"fraction": 0.3, "core": 0.5}.get(p.name, p.neutral) for p in subsurface.parameters]
    linear = linearised(*fit(clean, ParameterSpace.of(Model(), subsurface), 0, lambda space: theta))
    assert of_others(linear, "subsurface", ["lens_psf"], 1e12) == []  # a typical core is as wide as its range


def test_an_earlier_name_starts_again_within_its_range(clean):
    """A light's direction may be proposed below all that the light's effect allows."""
    peaked = replace(dark_corners, starts=lambda images: [{"amount": 0.9}])
    model = Model().with_effect(peaked, amount=0.1)
    fitter, both = fit(clean, ParameterSpace.of(model, builtin()["gain_error"]), 0)
    assert refit_at_peaks(fitter, both).theta[0] == pytest.approx(0.0, abs=0.01)


def brightened(light, view, amount, formula):
    """Ambient light that grows to the right."""
    return replace(light, ambient=light.ambient * (1.0 + formula(amount * (1.0 + view.field()[0]))))


@own("glow", stage=Stage.SURFACE, parameters=[replace(AMOUNT, high=3.0, typical=0.3)])
def glow(light, view, amount):
    """It grows linearly, says the image function."""
    return brightened(light, view, amount, lambda x: x)


def engine_law(x):
    return 1.3 * (np.exp(0.7 * x) - 1.0)


def glowing_by(clean, law):
    """A world whose ambient light follows a formula, without noise."""

    def exposed(o):
        light = brightened(Light.of(o.layers), o.view, TRUTH, law)
        return replace(o, measured=Model().signal(light, o.view, clean.nuisances).astype(np.float32))

    return replace(clean, train=tuple(map(exposed, clean.train)))


@pytest.fixture(scope="module")
def glowing(clean):
    """A world that follows the engine's formula."""
    return glowing_by(clean, engine_law)


def rendering_of(glowing, calls, law=engine_law):
    """The engine; calls gets the amount of each."""

    def rendering(model, samples=1):
        [(_, values)] = model.effects
        calls.append(values["amount"])
        before = {o.key: Light.of(o.layers) for o in glowing.train}
        after = {o.key: brightened(before[o.key], o.view, values["amount"], law) for o in glowing.train}
        return {key: (light.images[:3] - before[key].images[:3]).astype(np.float32) for key, light in after.items()}

    return rendering


def proposed_by(evidence, effect):
    """(the fitter, the fit of the image function)."""
    return fit(evidence, ParameterSpace.of(Model(), effect), 6, lambda space: [0.3])


def test_the_engines_images_find_the_parameter_that_the_formula_misses(glowing):
    calls = []
    fitter, proposed = proposed_by(glowing, glow)
    refined = fitted_to_renders(fitter, proposed, rendering_of(glowing, calls))
    assert abs(proposed.theta[0] - TRUTH) > 0.5 * TRUTH
    assert refined.theta[0] == pytest.approx(TRUTH, rel=0.1)
    assert refined.sums.total < 0.2 * proposed.sums.total and refined.effects[-1].id == "glow"
    assert len(calls) <= 5  # it and one step of it in each of two rounds, then it with more samples
    o = glowing.train[0]
    neutral = refined.effects[-1](Light.of(o.layers), o.view, amount=0.0)
    assert np.array_equal(neutral.ambient, o.layers.ambient)


@pytest.mark.parametrize("share, renders", [(0.9, True), (1.1, False)])
def test_a_fit_that_gains_too_little_to_be_named_is_not_rendered(glowing, monkeypatch, share, renders):
    simulated, calls = replace(glow, engine=lambda inputs, **values: inputs), []
    fitter, proposed = proposed_by(glowing, simulated)
    _, base = fit(glowing, ParameterSpace.of(Model()), 4)
    monkeypatch.setattr(refit, "_from_starts", lambda *_: proposed)
    chosen = [SimpleNamespace(id="glow", best=SimpleNamespace(atom=SimpleNamespace(effect=simulated)))]
    least = share * (base.sums.total - proposed.sums.total)
    found = refit.refits(fitter, fitter, base, chosen, rendering_of(glowing, calls), least)
    assert (len(calls) > 0) == found["glow"].rendered == renders


def test_one_render_tells_all_strengths_of_what_scales_the_light(clean):
    def twice(x):
        return 2.0 * x

    [amount] = glow.parameters
    linear, calls = replace(glow, parameters=(replace(amount, scales_light=True),)), []
    bright = glowing_by(clean, twice)
    fitter, proposed = proposed_by(bright, linear)
    refined = fitted_to_renders(fitter, proposed, rendering_of(bright, calls, twice))
    assert refined.theta[0] == pytest.approx(TRUTH, rel=1e-3) and len(calls) == 2


def test_a_search_by_small_steps_ends_with_what_its_rounds_reached(glowing):
    [amount] = glow.parameters
    careful = replace(glow, parameters=(replace(amount, slope_step=0.01),))
    fitter, proposed = proposed_by(glowing, careful)
    refined = fitted_to_renders(fitter, proposed, rendering_of(glowing, []))
    assert abs(refined.theta[0] - TRUTH) < abs(proposed.theta[0] - TRUTH)
    assert refined.sums.total < proposed.sums.total


def test_images_with_more_noise_than_news_are_rendered_once(clean):
    world, rng, calls = glowing_by(clean, lambda x: x), np.random.default_rng(3), []
    exact = rendering_of(world, calls, lambda x: 1.001 * x)
    fitter, proposed = proposed_by(world, glow)

    def noisy(model, samples=1):
        light = np.array([[[0.0]], [[0.0]], [[0.1 * world.train[0].layers.ambient.mean()]]])
        return {key: change + light * rng.normal(size=change.shape) for key, change in exact(model).items()}

    assert fitted_to_renders(fitter, proposed, noisy) is proposed and len(calls) == 1


def test_a_fit_to_images_that_are_no_better_is_the_formulas(glowing):
    fitter, proposed = proposed_by(glowing, glow)
    dark = rendering_of(replace(glowing, train=tuple(replace(o, layers=dimmed(o.layers)) for o in glowing.train)), [])
    assert fitted_to_renders(fitter, proposed, dark) is proposed


def dimmed(layers):
    """Layers without ambient light: the engine sees nothing of the effect."""
    return Layers(layers.direct, layers.indirect, 0.0 * layers.ambient, layers.flat, layers.depth_m, layers.normal,
                  layers.material)  # fmt: skip


@pytest.fixture(scope="module")
def curved(clean):
    """A world without noise, seen by a sensor whose values grow with the logarithm of light."""

    def logarithm(dn, view):
        return view.max_dn * np.log1p(CURVATURE * np.maximum(dn, 0.0) / view.max_dn) / np.log1p(CURVATURE)

    return seen(clean, logarithm)


def fitted_to_curve(curved, effect):
    return fit(curved, ParameterSpace.of(Model(), builtin().get(effect)), 8, lambda space: space.start + 0.1)


def test_a_curve_of_any_shape_takes_what_the_formula_of_the_response_leaves(curved):
    fitter, formula = fitted_to_curve(curved, "response_gamma")
    curve = refit_free_curve(fitter, formula)
    assert curve.sums.total < 0.2 * formula.sums.total
    assert curve.theta == pytest.approx(formula.theta, abs=0.05)
    dark = np.zeros((4, 4))
    (effect, _), view = curve.model.effects[0], curved.train[0].view
    for log_exponent in (0.0, 0.1):  # an offset in the dark would pass for dark signal
        np.testing.assert_array_equal(effect.apply(dark, view, log_exponent=log_exponent), dark)


@pytest.mark.parametrize("effect", ["gain_mismatch", "none"])
def test_what_is_no_curve_of_values_keeps_its_fit(curved, effect):
    fitter, formula = fitted_to_curve(curved, effect)
    assert refit_free_curve(fitter, formula) is formula


@pytest.mark.parametrize(
    "name, is_exact, share",
    [("interreflection", True, 0.14), ("flicker_banding", True, 0.035), ("response_gamma", False, 0.035)],
)
def test_renders_of_materials_miss_more_than_those_of_lamps(name, is_exact, share):
    assert missed_share(builtin()[name], is_exact, 0.035) == pytest.approx(share)
    assert missed_share(builtin()["lens_psf"], False, 0.035) >= 0.07


@pytest.mark.parametrize(("id", "beyond", "is_another"), [
    ("flicker_banding", 0.18, True), ("flicker_banding", 0.06, False), ("specular", 0.18, False),
])  # fmt: skip
def test_a_material_may_miss_less_in_what_it_cannot_look_like(monkeypatch, id, beyond, is_another):
    """Beside a material that gained 2.7, a further name of .18 is less than real materials may differ from the
    library's, and more than renders of the material differ beyond its looks."""
    monkeypatch.setattr("activestereo.diagnose.search.gain_beyond", lambda *_: beyond)
    named = Name(builtin()["subsurface"], {}, 2.7, 0.14)
    search = SimpleNamespace(_chi2=5.0, _pixels=1, _names=[named], _numbers=NUMBERS, _floor=lambda: 0.007)
    search._missed = partial(Search._missed, search)
    fit = SimpleNamespace(chi2=5.0 - 0.18, solution=SimpleNamespace(effects=(builtin()[id],)))
    assert Search._is_another(search, SimpleNamespace(residual=[0.0]), fit) == is_another
