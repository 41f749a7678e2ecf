# SPDX-License-Identifier: Apache-2.0
"""The part of a named effect that a formula misses is no other effect's gain."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from activestereo.capture.capture import read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import render_frames
from activestereo.diagnose.gather import gather
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.fitter import Fitter
from activestereo.diagnose.fitter import ParameterSpace
from activestereo.diagnose.dictionary import atoms_of, columns_of
from activestereo.diagnose.selection import freed, gain_beyond, stand_ins
from activestereo.diagnose.linear import linearised
from activestereo.diagnose.search import Search
from activestereo.effects import Light, Model, Parameter, Stage, builtin, effect
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world


@effect(
    "dark_corners",
    stage=Stage.OPTICS,
    family="f",
    source="s",
    parameters=[Parameter("amount", "1", neutral=0.0, low=0.0, high=0.5, typical=0.1)],
)
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


@effect(
    "haloes",
    stage=Stage.OPTICS,
    family="f",
    source="s",
    parameters=[Parameter("amount", "1", neutral=0.0, low=0.0, high=0.5, typical=0.1)],
)
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
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    alone = ParameterSpace.of(Model(), first)
    named = fitter.refine(alone, alone.start + 0.3, fitter.phi0(evidence.nuisances), 6)
    space = ParameterSpace.of(named.model, second)
    start = space.start.copy()
    start[len(named.theta)] += 0.05
    fit = fitter.refine(space, start, named.phi, 6)
    beyond = gain_beyond(freed(linearised(fitter, named), [first], 0.035), fit)
    assert low <= beyond / (named.sums.total - fit.sums.total) <= high


def warm_charge(image, view):
    """Dark current that doubles faster than usual."""
    return image + 400.0 * view.frame.exposure_s * view.frame.gain * 2.0 ** (view.warming_k / 5.0)


def test_what_may_stand_for_a_shape_of_a_name_is_told(clean):
    frames = {0: {"temperature_c": 45.0}, 2: {"exposure_s": 0.002}}
    taken = [replace(o.frame, **frames.get(o.frame.id, {})) for o in clean.train]
    train = (replace(o, frame=f, view=replace(o.view, frame=f)) for o, f in zip(clean.train, taken, strict=True))
    evidence = seen(replace(clean, train=tuple(train)), warm_charge)
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    space = ParameterSpace.of(Model(), builtin()["dark_signal"])
    linear = linearised(fitter, fitter.refine(space, np.array([300.0, 6.0]), fitter.phi0(evidence.nuisances), 8))
    assert of_others(linear, "dark_signal", ("black_level", "gain_mismatch", "lens_psf"), 1e-3) == ["black_level"]


def of_others(linear, name, others, floor):
    atoms = atoms_of(linear, [builtin()[other] for other in others], NUMBERS.prior_reach)
    return stand_ins(linear, builtin()[name], atoms, columns_of(linear, atoms, 1), floor, NUMBERS)


def test_what_may_stand_for_a_part_of_a_name_is_told(clean):
    frames = {0: {"temperature_c": 45.0}, 2: {"temperature_c": 35.0}}
    taken = [replace(o.frame, **frames.get(o.frame.id, {})) for o in clean.train]
    train = (replace(o, frame=f, view=replace(o.view, frame=f)) for o, f in zip(clean.train, taken, strict=True))
    evidence = replace(clean, train=tuple(train))
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    space = ParameterSpace.of(Model(), builtin()["chromatic_drift"])
    linear = linearised(fitter, fitter.refine(space, np.array([-0.02, 0.02]), fitter.phi0(evidence.nuisances), 0))
    assert of_others(linear, "chromatic_drift", ("laser_power_drift", "gain_error"), 1e-3) == ["laser_power_drift"]


def test_a_shape_is_looked_at_within_its_range(clean):
    fitter = Fitter(clean.train, clean.nuisance_prior(), clean.tiles)
    subsurface = builtin()["subsurface"]
    space = ParameterSpace.of(Model(), subsurface)
    theta = np.array([{"fraction": 0.3, "core": 0.5}.get(p.name, p.neutral) for p in subsurface.parameters])
    linear = linearised(fitter, fitter.refine(space, theta, fitter.phi0(clean.nuisances), 0))
    assert of_others(linear, "subsurface", ["lens_psf"], 1e12) == []  # a typical core is as wide as its range


def test_an_earlier_name_starts_again_within_its_range(clean):
    """A light's direction may be proposed below all that the light's effect allows."""
    fitter = Fitter(clean.train, clean.nuisance_prior(), clean.tiles)
    peaked = replace(dark_corners, starts=lambda images: [{"amount": 0.9}])
    space = ParameterSpace.of(Model().with_effect(peaked, amount=0.1), builtin()["gain_error"])
    fit = fitter.refine(space, space.start, fitter.phi0(clean.nuisances), 0)
    found = Search._refit_at_peaks(SimpleNamespace(_fitter=fitter), fit)
    assert found.theta[0] == pytest.approx(0.0, abs=0.01)
