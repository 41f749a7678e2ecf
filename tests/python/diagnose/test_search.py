# SPDX-License-Identifier: Apache-2.0
"""Parts of a search: starts, columns, sets, the cost of freedom, what a ranking tells of a round, and the verdict."""

from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.capture.capture import SIDES, SPLITS
from activestereo.diagnose.depth_engine import pose_error_nats
from activestereo.diagnose.diagnosis import _test_errors
from activestereo.diagnose.dictionary import Atom, carried
from activestereo.diagnose.evidence import NuisancePrior, one_of_each_situation
from activestereo.diagnose.fields import dots_seen
from activestereo.diagnose.fitter import Fitter, ParameterSpace
from activestereo.diagnose.geometry_search import GivenUp
from activestereo.diagnose.goodness import Interval, interval, occam_nats
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.pixels import SCALES
from activestereo.diagnose.ranking import ranking_of
from activestereo.diagnose.refit import Refit
from activestereo.diagnose.outcome import Name, Round, takes_any_light
from activestereo.diagnose.search import Search
from activestereo.diagnose.selection import Hit, _candidate
from activestereo.diagnose.verdict import EFFECT, NONE, UNDETERMINED, UNKNOWN, Remainder, probability_right, verdict_of
from activestereo.effects import Model, Parameter, builtin
from activestereo.effects.core.descriptor import Lever, StartImage
from activestereo.effects.core.dots import DotView
from activestereo.effects.lights import flicker_starts, unit_starts
from effect_worlds import seen, view_of

EFFECTS = builtin()
WHOLE = SimpleNamespace(binning=1)


def test_columns_follow_their_pixels_to_another_fitter():
    """A capture that stands elsewhere sees other surfaces, and keeps the same pixels in another order."""
    first = fitter_of([0, 1, 2, 3], [1.0, 1.0, 2.0, 2.0])
    other = fitter_of([2, 0, 3, 5], [4.0, 1.0, 2.0, 1.0])
    columns = np.array([[10.0, 11.0, 12.0, 13.0]], np.float32)
    assert carried(columns, first, other).tolist() == [[24.0, 10.0, 13.0, 0.0]]


def fitter_of(index, root_weight):
    """As much of a Fitter as columns are carried by."""
    measured = SimpleNamespace(size=6)
    pixels = SimpleNamespace(
        index=np.array(index), root_weight=np.array(root_weight), observation=SimpleNamespace(measured=measured)
    )
    return SimpleNamespace(pixels=lambda: [pixels])


def test_what_a_name_cannot_be_told_from_has_the_figures_of_its_own_round():
    """A name of an earlier round may have gone as needless."""
    vignetting = EFFECTS["vignetting"]
    rounds = round_of(200.0, radial_distortion=150.0, projector_vignetting=190.0), round_of(150.0, vignetting=100.0,
        projector_vignetting=110.0)  # fmt: skip
    found = {p.name: Interval(p.typical, p.low, p.high, p.unit) for p in vignetting.parameters}
    outcome = SimpleNamespace(
        names=(Name(vignetting, {"vignetting": 0.8, "projector_vignetting": 0.2}, 0.5, seen=rounds[1]),),
        rounds=rounds,
        noise={"vignetting": SimpleNamespace(effect=vignetting, nats=0.0, parameters=lambda: found)},
        first=fitted("vignetting", 200.0),
        solution=fitted("vignetting", 100.0),
        fitter=SimpleNamespace(pixels_used=lambda: 100, tile_pixels=lambda: np.full(4, 25)),
        rest=Remainder(1.0, 0.0, 0.0, 1.0),
    )
    twin = ranking_of(outcome, NUMBERS, True, str)[1]
    assert (twin["effect"], twin["equivalent"]) == ("projector_vignetting", ["vignetting"])
    assert twin["gain_reduced_chi2"] == pytest.approx((150.0 - 110.0) / 100)


def test_an_effect_that_may_hide_in_what_a_formula_misses_joins_its_set(monkeypatch):
    """A second fault of .01 of the noise is less than the formula of the first may have missed, of .3."""
    first, other = EFFECTS["principal_point_offset"], EFFECTS["prnu"]
    names = [Name(first, {first.id: 1.0}, 0.3, 0.07, seen=object()), Name(other, {other.id: 1.0}, 0.5, field=object())]
    search = SimpleNamespace(
        _names=names,
        _rounds=[round_of(1000.0, baseline_drift=990.0, gain_error=999.0)],
        _solution=SimpleNamespace(model=Model().with_effect(first)),
        _chi2=1000.0,
        _numbers=NUMBERS,
        _effect=EFFECTS.get,
        _is_open=lambda effect: effect is not first,
        _floor=lambda: 7.0,
        _effects=None,
        _fitter=None,
    )
    monkeypatch.setattr("activestereo.diagnose.search.members_of", lambda left, *_: dict.fromkeys(left, 1.0))
    search._widen_set = partial(Search._widen_set, search)
    Search._widen_set_of_inexact(search)
    assert names[0].members == {first.id: pytest.approx(0.95), "baseline_drift": pytest.approx(0.05)}
    assert names[1].members == {other.id: 1.0}


@pytest.mark.parametrize("is_rough", [False, True])
def test_effects_propose_trial_points_again_where_structure_is_left(monkeypatch, is_rough):
    """A blur hides a second projector's dots until it is named."""
    unit, likely = EFFECTS["second_projector"], EFFECTS["vignetting"]
    parts = {"atoms_of": lambda _, some, *__: [Atom(e, {}, (), (), (), 0) for e in some], "columns_of": lambda *_: None}
    parts |= {"scores": lambda *_: None, "candidates": lambda atoms, *_: [a.effect.id for a in atoms]}
    for name, part in parts.items():
        monkeypatch.setattr(f"activestereo.diagnose.search.{name}", part)
    search = SimpleNamespace(_numbers=NUMBERS, _pixels=1)
    found = Search._found_again(search, None, [Atom(likely, {}, (), (), (), 0)], {likely.id}, [unit] * is_rough)
    assert found == [likely.id, unit.id][: 1 + is_rough]


@pytest.mark.parametrize(
    ("image", "draws", "takes_any"),
    [
        ("subsurface", ("dot_gain_spread", "speckle_static"), True),
        ("subsurface", ("dot_gain_spread", "prnu"), False),
        ("subsurface", ("speckle_static",), False),
        (None, ("dot_gain_spread", "speckle_static"), False),
    ],
)
def test_draws_of_dots_and_of_views_take_any_error_beside_another_name(image, draws, takes_any):
    named = Name(EFFECTS[image], {image: 1.0}, 1.0, seen=round_of(100.0)) if image else None
    names = [Name(EFFECTS[id], {id: 1.0}, 0.3, field=object(), seen=round_of(90.0)) for id in draws]
    assert takes_any_light(([named] if named else []) + names) == takes_any


@pytest.mark.parametrize(
    ("left", "named", "members"),
    [
        ({"radial_distortion": 0.07, "pattern_scale_drift": 0.04}, "pattern_scale_drift", 1),
        ({"radial_distortion": 0.044, "pattern_scale_drift": 0.046}, "radial_distortion", 2),
        ({"radial_distortion": 0.04, "pattern_scale_drift": 0.07}, "radial_distortion", 1),
        ({"radial_distortion": 0.04, "pattern_scale_drift": None}, "radial_distortion", 1),
    ],
)
def test_a_close_rival_is_judged_at_poses_of_its_own(left, named, members):
    """Poses that were found without either effect had taken most of both. The weights that each leads to judge
    neither. The last one is given up, because its poses leave more at once."""
    now = round_of(1000.0, radial_distortion=962.0, pattern_scale_drift=973.0)
    names = [Name(EFFECTS["radial_distortion"], {"radial_distortion": 1.0}, 0.038, seen=now)]
    search = SimpleNamespace(_names=names, _pixels=1000, _numbers=NUMBERS, _floor=lambda: 7.0, _effect=EFFECTS.get)
    weights = {"radial_distortion": 1.0, "pattern_scale_drift": 0.5}

    def accept(fit, at_most=np.inf):
        effect = fit.effects[-1].id
        if left[effect] is None:
            assert at_most == pytest.approx(1.05 + 0.007)
            raise GivenUp
        seen = SimpleNamespace(weight=np.full((2, 2), weights[effect]), picked=lambda: slice(None))
        search._rows = [SimpleNamespace(observation=seen, residual=np.full((2, 2), np.sqrt(1.0 + left[effect])))]
        search._evidence = SimpleNamespace(train=[seen], geometry=SimpleNamespace(left=1.05))
        search.accepted = effect
        return True

    whole = SimpleNamespace(picked=lambda: slice(None))
    search._rows = [SimpleNamespace(observation=whole, residual=np.full((2, 2), 2.0))]  # before either is named
    search._accept, search._widen_set = accept, partial(Search._widen_set, search)
    Search._accept_last(search, now.fits)
    assert (names[0].id, len(names[0].members), search.accepted) == (named, members, named)
    assert sum(names[0].members.values()) == pytest.approx(1.0)


def round_of(chi2, **fits):
    return Round({}, {}, chi2, 0.0, 0.0, {name: Refit(fitted(name, total)) for name, total in fits.items()})


def fitted(name, chi2):
    """As much of a Solution as a ranking looks at."""
    sums = SimpleNamespace(total=chi2, tile_chi2=np.full(4, chi2 / 4))
    neutral = np.array([p.neutral for p in EFFECTS[name].parameters])
    return SimpleNamespace(sums=sums, effects=[EFFECTS[name]], theta=neutral)


@pytest.mark.parametrize(
    "rest, named, floor, verdict",
    [
        (Remainder(0.0, 0.02, 0.01, 0.01), False, True, NONE),
        (Remainder(0.0, 0.02, 0.01, 0.01), False, False, UNDETERMINED),
        (Remainder(0.0, 0.7, 0.01, 0.01), False, True, UNKNOWN),
        (Remainder(0.0, 0.3, 0.2, 0.2), False, True, UNKNOWN),
        (Remainder(0.0, 0.02, 0.01, 0.01, strain=3.0), False, True, NONE),
        (Remainder(0.0, 0.02, 0.01, 0.01, strain=9.0), False, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6), True, False, EFFECT),
        (Remainder(0.0, 0.3, 0.01, 0.01), True, True, EFFECT),
        (Remainder(0.0, 0.7, 0.01, 0.01), True, True, UNKNOWN),
        (Remainder(0.8, 0.1, 0.07, 0.4), True, True, EFFECT),
        (Remainder(0.8, 0.1, 0.07, 0.4, names=3), True, True, UNKNOWN),
        (Remainder(2.7, -0.4, 0.001, -0.013), True, True, EFFECT),
        (Remainder(0.04, 0.0, 0.03, 0.03, drawn=0.04), True, True, EFFECT),
        (Remainder(0.04, 0.5, 0.03, 0.03, drawn=0.04), True, True, UNKNOWN),
        (Remainder(0.25, 0.0, 0.02, 0.02, drawn=0.23, names=0), True, True, EFFECT),
        (Remainder(0.8, 0.02, 0.01, 0.6, test_explained=0.9, test_left=0.25), True, True, EFFECT),
        (Remainder(0.8, 0.02, 0.01, 0.6, test_explained=0.3, test_left=0.4), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, test_explained=0.9, test_left=0.25, test_unlike=1.5), True, True, UNKNOWN),
        (Remainder(0.0, 0.02, 0.01, 0.01, test_left=0.2), False, True, NONE),
        (Remainder(0.0, 0.02, 0.01, 0.01, test_left=0.6), False, True, UNKNOWN),
        (Remainder(0.34, 0.3, 0.0, 0.1, drawn=0.07), True, True, UNKNOWN),
        (Remainder(13.3, 0.41, 0.014, 0.035, drawn=12.9), True, True, EFFECT),
        (Remainder(13.3, 0.95, 0.014, 0.035, drawn=12.9), True, True, UNKNOWN),
        (Remainder(0.1, 0.08, 0.04, 0.07), True, True, UNKNOWN),
        (Remainder(0.1, 0.08, 0.03, 0.07, test_explained=0.1, test_left=0.03), True, True, EFFECT),
        (Remainder(0.1, 0.08, 0.04, 0.07, test_explained=0.1, test_left=0.3), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, test_explained=0.1, test_left=0.13), True, True, UNKNOWN),
        (Remainder(0.38, 0.13, 0.09, 0.43, test_explained=0.64, test_left=0.44), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, strain=5.0), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, is_full=True), True, True, UNKNOWN),
    ],
)
def test_the_verdict_follows_from_what_is_explained_and_left(rest, named, floor, verdict):
    assert verdict_of(rest, named, floor, NUMBERS) == verdict


@pytest.mark.parametrize("left, denies", [(1.0, False), (3.0, True)])
def test_test_frames_deny_names_beside_draws_of_their_own(left, denies):
    """Each frame has its own draws, which no model foretells: what they leave grows as the square of the light, here
    fourfold, and says nothing. Pixels of weight 0 do not count."""
    speckle = SimpleNamespace(random_terms=[SimpleNamespace(lever=Lever.SIGNAL)])
    frames = [
        SimpleNamespace(id=i, split=split, projector_power=1.0, exposure_gain=1.0) for i, split in enumerate(SPLITS)
    ]
    squares = {"train": 1.25, "test": 1.0 + left}
    train, test = (
        [
            SimpleNamespace(key=(f.id, side), weight=np.eye(4) < 0.5, pixels=12, picked=lambda: slice(None), view=WHOLE)
            for f in frames
            for side in SIDES
            if f.split == split
        ]
        for split in ("train", "test")
    )
    outcome = SimpleNamespace(
        rest=Remainder(0.5, 0.02, 0.01, 0.6, drawn=0.1),
        names=[SimpleNamespace(id="speckle", field=1, effect=speckle), SimpleNamespace(id="vignetting", field=None)],
        noise=(),
        solution=SimpleNamespace(nuisances=SimpleNamespace(black_dn=5.0)),
        evidence=SimpleNamespace(train=train),
    )

    def errors(more):
        return SimpleNamespace(
            capture=SimpleNamespace(frames=frames),
            predictions={(f.id, side): np.full((4, 4), 5.0 + 10.0 * (1 + f.id)) for f in frames for side in SIDES},
            layers={f.id: dict.fromkeys(SIDES, SimpleNamespace(projector=np.ones((4, 4)))) for f in frames},
            squares_of_blocks=lambda key, _: np.where(np.eye(4) < 0.5, squares[SPLITS[key[0]]] + more, 1e6),
        )

    explained, unexplained, _ = _test_errors(outcome, test, errors(0.4), errors(0.0), NUMBERS)
    assert (explained, unexplained) == (pytest.approx((0.4, left - 4.0 * 0.25)) if denies else (None, None))
    tested = replace(outcome.rest, test_explained=explained, test_left=unexplained)
    assert (verdict_of(tested, True, True, NUMBERS) == UNKNOWN) == denies


@pytest.mark.parametrize("after, unlike", [((1.1, 1.1), 0.1 / 0.8), ((1.1, 1.75), 0.75 / NUMBERS.scene_error)])
def test_each_test_frame_has_to_confirm_a_name(after, unlike):
    """The mean of both frames confirms either name; the second frame denies one."""
    test = [
        SimpleNamespace(
            key=i, frame=SimpleNamespace(id=i), weight=np.ones(4), pixels=4, picked=lambda: slice(None), view=WHOLE
        )
        for i in range(2)
    ]
    outcome = SimpleNamespace(names=[SimpleNamespace(id="thermal_drift", field=None, effect=None)], noise=())
    standing, named = (
        SimpleNamespace(squares_of_blocks=lambda i, _, both=both: np.full(4, both[i])) for both in ((2.4, 1.9), after)
    )
    explained, left, found = _test_errors(outcome, test, standing, named, NUMBERS)
    assert found == pytest.approx(unlike)
    mean = Remainder(0.8, 0.02, 0.01, 0.6, test_explained=explained, test_left=left)
    assert verdict_of(mean, True, True, NUMBERS) == EFFECT
    assert verdict_of(replace(mean, test_unlike=found), True, True, NUMBERS) == (UNKNOWN if unlike > 1.0 else EFFECT)


def test_a_name_is_stated_the_likelier_right_the_less_is_missing():
    stated = [probability_right(missing, True) for missing in (0.1, 0.4, 0.9, 1.5, 1e9)]
    assert stated == sorted(stated, reverse=True)
    assert 0.1 < stated[-1] < 0.3 and 0.98 < stated[0] < 1.0
    assert probability_right(0.5, False) > 0.5 > probability_right(1.5, False)


@pytest.fixture(scope="module")
def scene():
    light, geometry = seen(bounces=0)
    return light, view_of(geometry)


@pytest.mark.parametrize(("x", "yaw"), [(0.14, 0.02), (-0.2, 0.1)])
def test_a_second_units_place_is_found_from_its_dots(scene, x, yaw):
    (light, view), unit = scene, EFFECTS["second_projector"]
    view = replace(view, frame=replace(view.frame, projector_power=0.0))
    place = {"intensity_m2": 6.0, "offset_x_m": x, "yaw_rad": yaw}
    ambient_dn = 500.0 * view.frame.exposure_gain
    added = ambient_dn * (unit(light, view, **place).ambient - light.ambient)
    residual = added + np.random.default_rng(1).normal(0.0, added.std(), added.shape)
    weight, ambient = np.full(view.shape, added.var() ** -1), ambient_dn * light.ambient
    image = StartImage(view, light, weight, residual, ambient, ambient_dn, ambient)
    found = unit_starts([image])[0]
    # A pixel of this small camera is 19 mrad wide.
    assert found["yaw_rad"] == pytest.approx(yaw, abs=0.03)
    assert found["offset_x_m"] == pytest.approx(x, abs=0.03)
    assert found["intensity_m2"] == pytest.approx(6.0, rel=0.5)


@pytest.mark.parametrize("name", ["double_image", "lens_psf"])
def test_each_start_of_a_fit_comes_with_its_atom(name):
    lead = EFFECTS[name].parameters[0]
    atom = Atom(EFFECTS[name], EFFECTS[name].neutral_values, ((lead.name, 0.1),), (False,), (1.0,), 0)
    starts = _candidate([Hit(atom, None, np.ones(1), 1.0, 1.0, 0.5)]).starts
    assert starts and all(own is atom and values[lead.name] == lead.neutral + 0.1 for own, values in starts)


@pytest.mark.parametrize(
    ("peak", "coefficient", "starts"), [(0.7, 0.2, [0.14, 0.7]), (0.8, 1.15, [0.92, 0.8]), (0.8, 1.05, [0.84])]
)
def test_a_narrow_peak_is_a_start_itself_where_its_line_leads_away(peak, coefficient, starts):
    """A well that is full a little below its place cuts off far more: the line ends where it cuts nothing, or most."""
    effect = EFFECTS["saturation_blooming"]
    atom = Atom(effect, effect.neutral_values, (("lost_range", peak),), (False,), (1.0,), 0)
    found = _candidate([Hit(atom, None, np.full(1, coefficient), 1.0, 1.0, -2.0)])
    assert [values["lost_range"] for _, values in found.starts] == [pytest.approx(start) for start in starts]


@pytest.mark.parametrize(("fraction", "u", "v"), [(0.2, 5.0, -2.0), (0.4, -3.0, 0.0)])
def test_a_panes_second_image_is_found_at_its_shift(scene, fraction, u, v):
    """Beside a scale of the image that is fitted too."""
    (light, view), rng = scene, np.random.default_rng(1)
    image = 200.0 * light.direct / light.direct.max() + 20.0 * light.ambient / light.ambient.max()
    both = EFFECTS["double_image"](image, view, fraction=fraction, shift_u_px=u, shift_v_px=v)
    residual = both - 1.1 * image + rng.normal(0.0, 1.0, image.shape)
    seen_there = StartImage(view, light, np.ones(view.shape), residual, image, 1.0, image)
    found = EFFECTS["double_image"].starts([seen_there])[0]
    assert (found["shift_u_px"], found["shift_v_px"]) == (u, v)
    assert found["fraction"] == pytest.approx(fraction, abs=0.03)


def test_a_flickers_starts_are_of_different_frequencies_and_no_deeper_than_its_mean():
    flicker, ambient, images = EFFECTS["flicker_banding"], np.full((60, 4), 40.0), []
    truth = {"depth": 0.6, "frequency_hz": 107.36, "phase_rad": 0.7, "line_time_s": 2e-5}
    frames = [SimpleNamespace(timestamp_s=t, exposure_s=0.002) for t in (0.0, 0.97, 2.31, 4.88)]
    seen_dn = [
        flicker(SimpleLight(ambient), SimpleNamespace(shape=ambient.shape, frame=f), **truth).ambient for f in frames
    ]
    level = np.mean(seen_dn) / 40.0  # a fit without flicker takes its mean for the light
    for frame, image in zip(frames, seen_dn, strict=True):
        view, weight = SimpleNamespace(frame=frame), np.ones(ambient.shape)
        images.append(StartImage(view, None, weight, image - level * ambient, level * ambient, level, image))
    starts = flicker_starts(images)
    assert starts[0]["frequency_hz"] == pytest.approx(107.36, abs=0.02)
    assert starts[0]["depth"] == pytest.approx(0.6, rel=0.05) and starts[0]["line_time_s"] == pytest.approx(2e-5)
    assert len({start["frequency_hz"] for start in starts}) == len(starts) > 3
    assert max(start["depth"] for start in starts) <= 1.0
    space = ParameterSpace.of(Model(), flicker)
    at = [p.name for _, p in space.pairs].index("frequency_hz")
    # Over the frames' five seconds a slope's step may turn the wave by a small part of a radian.
    assert 2 * np.pi * 4.88 * space.steps(space.start)[at] < 0.1


@dataclass(frozen=True)
class SimpleLight:
    """The part of a Light that a flicker changes."""

    ambient: np.ndarray


@dataclass(frozen=True)
class Image:
    """The part of an Observation that a scan's choice uses."""

    frame: SimpleNamespace
    side: str
    measured: np.ndarray
    pick: np.ndarray | None = None

    @property
    def pixels(self) -> int:
        return self.measured.size


def test_one_image_of_each_situation_sees_two_instants_of_repeats():
    pose = dict(camera_to_world=np.eye(4), projector_power=1.0, ambient=None, temperature_c=None, is_moving=False)
    gains = 1.0, 1.0001, 1.0002, 1.4  # exposures jitter, and the last frame is no repeat
    frame = lambda k, group: SimpleNamespace(id=k, repeat_group=group, exposure_gain=gains[k], **pose)  # noqa: E731
    images = [Image(frame(k, 0), side, np.zeros((8, 8))) for k in range(4) for side in ("left", "right")]
    chosen = {(o.frame.id, o.side) for o in one_of_each_situation(images)}
    assert chosen == {(0, "right"), (2, "left"), (3, "right")}
    single = [Image(frame(0, None), side, np.zeros((8, 8))) for side in ("left", "right")]
    assert {(o.frame.id, o.side) for o in one_of_each_situation(single)} == {(0, "right"), (0, "left")}


def test_few_poses_of_large_images_are_looked_at_but_every_setting():
    def frame(number, power):
        light = dict(exposure_gain=1.0, projector_power=power, ambient=None, temperature_c=None)
        return SimpleNamespace(
            id=number, repeat_group=None, is_moving=False, camera_to_world=np.eye(4) + number // 2, **light
        )

    frames = [frame(k, k % 2) for k in range(8)]  # four poses, the projector off and on at each
    images = [Image(f, side, np.zeros((8, 8))) for f in frames for side in ("left", "right")]
    chosen = [(o.frame.id, o.side) for o in one_of_each_situation(images, most_pixels=150)]
    assert chosen == [(0, "left"), (0, "right"), (1, "right"), (2, "right"), (3, "right")]
    assert len(one_of_each_situation(images, most_pixels=1)) == 3  # one of each setting, and the left image
    assert len(one_of_each_situation(images)) == 9


def explanation(name, values, information):
    """A fit with given values of an effect's parameters, and what the data say of each (1 / variance)."""
    parameters = EFFECTS[name].parameters
    neutral, nothing = np.array([p.neutral for p in parameters]), np.zeros(len(parameters), bool)
    space = SimpleNamespace(given=nothing, neutral=neutral, pairs=[(EFFECTS[name], p) for p in parameters])
    sums = SimpleNamespace(gram=np.diag(information))
    fitter = SimpleNamespace(prior=lambda n, space: np.zeros(n))
    return fitter, SimpleNamespace(space=space, theta=np.array(values), sums=sums), EFFECTS[name]


def test_freedom_costs_by_how_finely_it_was_used():
    cost = [-occam_nats(*explanation("vignetting", [1.5], [n]), design=1.0) for n in (1e2, 1e4, 1e6)]
    assert np.diff(cost) == pytest.approx(np.log(10.0), rel=0.05)
    assert -occam_nats(*explanation("vignetting", [1.5], [4e6]), design=4.0) == pytest.approx(cost[2])


def test_an_effect_of_more_parameters_is_less_likely_where_one_of_them_is_enough():
    """A parameter that the data do not tell gains nothing by itself."""
    one = occam_nats(*explanation("stereo_pitch", [0.0035], [1e12]), design=1.0)
    both = occam_nats(*explanation("pattern_scale_drift", [0.014, 0.0], [1e12 / 16.0, 0.0]), design=1.0)
    assert one - both == pytest.approx(np.log(3.0), abs=0.01)


def test_what_the_data_do_not_tell_costs_next_to_nothing():
    penalty = occam_nats(*explanation("black_level", [0.0, 0.4], [0.0, 1e6]), design=1.0)
    assert penalty - occam_nats(*explanation("black_level", [0.0, 0.4], [0.0, 1e6 + 1]), design=1.0) == pytest.approx(
        0.0, abs=1e-3
    )
    far = occam_nats(*explanation("black_level", [0.0, 0.8], [0.0, 1e6]), design=1.0)
    assert penalty - far == pytest.approx(2 * np.log(2.0), abs=0.05)  # amplitudes: a power law's tail
    usual, odd = (occam_nats(*explanation("dark_signal", [100.0, k], [1e-2, 100.0]), design=1.0) for k in (7.0, 4.0))
    # Cauchy's density at three deviations; the usual value need not be told from the neutral one.
    assert usual - odd == pytest.approx(np.log(10.0 * np.pi) + 0.5 * np.log(101.0 / (2.0 * np.pi)), abs=0.01)


@pytest.mark.parametrize(("apart_px", "square_px", "low", "high"), [(12, 3.0, 0.9, 1.1), (5, 8.0, 0.6, 0.8)])
def test_dots_that_share_pixels_show_less_of_their_own_gains(scene, apart_px, square_px, low, high):
    """Pixels of this camera are 2.8 pattern pixels wide."""
    light, view = scene
    rows, columns = np.mgrid[0:200, 0:320]
    pattern = np.exp(
        -(((rows % apart_px) - apart_px // 2) ** 2 + ((columns % apart_px) - apart_px // 2) ** 2) / square_px
    )
    view = replace(view, pattern=pattern)
    dots = light.flat * DotView.of(view).nominal()
    of_pixels = lambda residuals: (residuals[0] ** 2).sum() / (dots**2).sum()  # noqa: E731
    assert low < dots_seen([(SimpleNamespace(view=view), None, dots, None)], of_pixels) < high


def test_what_formulas_lack_widens_a_shapes_interval_by_its_value_and_a_choices_not_at_all():
    focus, strength = (
        Parameter(name, "m", neutral=neutral, low=0.0, high=5.0, typical=1.0)
        for name, neutral in (("focus", 1.0), ("strength", 0.0))
    )
    (_, low, high), (_, other_low, other_high) = interval(focus, 1.5, 0.0), interval(strength, 1.5, 0.0)
    assert high - low == pytest.approx(other_high - other_low)
    place = Parameter("place", "bits", neutral=0.0, low=0.0, high=8.0, typical=1.0, choice=True)
    assert interval(place, 3.0, 1.0) == (3.0, 3.0, 3.0)


@pytest.mark.parametrize(("nats", "offset_px"), [(19.5, 0.6), (150.0, 1.8), (0.5, 3.0)])
def test_what_misplaced_cameras_explain_is_no_fault_of_the_depth_engine(nats, offset_px):
    pose_error_px = 0.27
    tried = np.linspace(0.0, offset_px, 20001)
    likelihood = nats * (1.0 - (1.0 - tried / offset_px) ** 2)
    misplaced = (likelihood - 0.5 * (tried / pose_error_px) ** 2).max()
    assert pose_error_nats(nats, np.array([0.6, 0.8]) * offset_px, pose_error_px) == pytest.approx(misplaced, abs=1e-4)


def test_how_far_a_fit_takes_calibration_and_measurement_counts_the_farthest_in_its_own_deviations():
    fitter = Fitter([], NuisancePrior(np.zeros(3), np.array([6e-4, 6e-4, 0.03]), 1), 1)
    phi = np.array([5.0, 9.0, 20.0, 6e-4, -1.8e-3, 0.06])  # scales and black level have no prior
    assert fitter.prior_sigmas(SimpleNamespace(phi=phi)) == pytest.approx(3.0)
    base = SimpleNamespace(phi=np.array([5.0, 9.0, 20.0, 0.0, -1.2e-3, 0.06]))
    assert fitter.prior_sigmas(SimpleNamespace(phi=phi), base) == pytest.approx(1.0)  # what goes beyond the base's
    weighed_up = NuisancePrior(np.zeros(3), np.array([6e-4, 6e-4, 0.03]) / 5.0, 1, weighed_up=25.0)
    assert Fitter([], weighed_up, 1).prior_sigmas(SimpleNamespace(phi=phi)) == pytest.approx(3.0)  # as stated
    nothing = NuisancePrior(np.array([]), np.array([]), 0)
    assert Fitter([], nothing, 1).prior_sigmas(SimpleNamespace(phi=phi[:SCALES])) == 0.0


def test_what_a_scene_measurement_may_have_wrong_widens_an_interval():
    """An effect and a focal length that move the images alike: the data tell their sum, the scene measurement one of
    them."""
    sigma, weight = 6e-4, 1e10
    fitter = Fitter([], NuisancePrior(np.zeros(2), np.array([sigma, sigma]), 0), 1)
    size = 1 + SCALES + 2
    alike = np.zeros(size)
    alike[[0, 1 + SCALES]] = 1.0, 1.0  # of the effect's parameter and the left camera's focal length
    gram = weight * np.outer(alike, alike) + np.diag([0.0, *[weight] * SCALES, 0.0, weight])
    space = SimpleNamespace(low=np.array([-1.0]), high=np.array([1.0]))
    sums = SimpleNamespace(gram=gram, block_moment={"left": np.zeros((size, 1))})
    deviation = np.sqrt(fitter.covariance(SimpleNamespace(theta=np.zeros(1), space=space, sums=sums))[0, 0])
    assert deviation == pytest.approx(sigma, rel=0.01)
