# SPDX-License-Identifier: Apache-2.0
"""Where fits of narrow peaks start, and what an explanation's freedom costs."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.benchmarks.example_capture import HIDDEN, write_example_capture
from activestereo.diagnose import diagnose
from activestereo.effects import Model, builtin
from activestereo.effects.core.dots import DotView
from activestereo.effects.lights import flicker_starts
from activestereo.effects.core.descriptor import StartImage
from activestereo.effects.lights import unit_starts
from activestereo.diagnose.fields import dots_seen
from activestereo.diagnose.evidence import one_of_each_situation
from activestereo.diagnose.fitter import ParameterSpace
from activestereo.diagnose.goodness import occam_nats
from activestereo.diagnose.dictionary import Atom
from activestereo.diagnose.selection import Hit, _candidate
from effect_worlds import seen, view_of

EFFECTS = builtin()


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


def test_a_fit_begins_at_its_starts_nuisances(tmp_path):
    """Vignetting of cos^3 takes half of the light of whole images. From the scales without it, a step from a start of
    twice the exponent fails."""
    write_example_capture(tmp_path / "capture", samples_per_pixel=8, hidden="vignetting")
    few = {name: EFFECTS[name] for name in ("vignetting", "lens_psf")}
    found = diagnose(tmp_path / "capture", effects=few, samples_per_pixel=8, workers=1).result
    assert found["added"] == ["vignetting"]
    assert found["ranking"][0]["parameters"]["exponent"]["value"] == pytest.approx(HIDDEN["vignetting"][1], rel=0.05)


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
    pose = dict(camera_to_world=np.eye(4), exposure_gain=1.0, projector_power=1.0, ambient=None, temperature_c=None)
    frame = lambda k, group: SimpleNamespace(id=k, repeat_group=group, is_moving=False, **pose)  # noqa: E731
    images = [Image(frame(k, 0), side, np.zeros((8, 8))) for k in range(3) for side in ("left", "right")]
    chosen = {(o.frame.id, o.side) for o in one_of_each_situation(images)}
    assert chosen == {(0, "right"), (2, "left")}
    single = [Image(frame(0, None), side, np.zeros((8, 8))) for side in ("left", "right")]
    assert {(o.frame.id, o.side) for o in one_of_each_situation(single)} == {(0, "right"), (0, "left")}


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
