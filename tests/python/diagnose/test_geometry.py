# SPDX-License-Identifier: Apache-2.0
"""Views, projector, focal lengths and albedos that differ from what a capture states: their signature in the images by
closed form, and that they are found, told and taken into account."""

import json
import shutil
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from activestereo.capture.capture import Uncertainty, read_capture
from activestereo.capture.capture_json import CaptureError
from activestereo.common.pose import motion_of_twist
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.nuisances import Nuisances, predict
from activestereo.compare.render import render_frames
from activestereo.diagnose.fitter import Fitter, ParameterSpace
from activestereo.diagnose.found_model import albedo_json, albedo_surfaces, found_model, geometry_json
from activestereo.diagnose.gather import gather
from activestereo.diagnose.geometry import TWIST, Geometry, derivatives_in_dn, focal_slopes, geometry_slopes
from activestereo.diagnose.geometry_search import (
    GivenUp,
    _moving_beyond_others,
    _step,
    coarse,
    gather_where_it_stands,
    with_test_frames,
)
from activestereo.diagnose.linear import fitted_model
from activestereo.diagnose.pixels import DENSE
from activestereo.diagnose.search import Search
from activestereo.diagnose.settings import Settings
from activestereo.diagnose.words import geometry_words, next_steps
from activestereo.effects import Model, builtin
from activestereo.effects.core.laws import example_view
from activestereo.effects.core.resample import SupersampledImages
from activestereo.effects.core.surfaces import scene_surfaces
from activestereo.effects.core.view import Layers, transform
from activestereo.model import SensorModel
from activestereo.model.diagnosed import calibrated
from activestereo.model.model import MeasuredPose
from activestereo.model.read import read_model
from activestereo.model.write import write_model
from lab_worlds import RememberingRenderer, WorldRenderer
from report_worlds import DIAGNOSIS

# Radians of phase per metre of the wall's albedo, and per pixel of the pattern.
GRAIN, WAVE = 8.0, 0.06
POSE = np.array([0.008, -0.006, 0.004, 0.008, -0.004, 0.006])
PROJECTOR = np.array([0.002, 0.0012, -0.0016, 0.004, -0.005, 0.003])
UNMOVED = np.eye(4)
ROUGH = Uncertainty(pose_m=0.01, pose_rad=0.01, projector_m=0.002, projector_rad=0.005)
# Dots 2.9 pixels apart, as in the benchmark suite's worlds: radians of phase per unit of a direction's tangent.
PHASE = 130.0
MARGIN_PX = 4
LIGHT = Nuisances(9.0e4, 3.0e3, 4.0)


def seen(view, camera=UNMOVED, projector=UNMOVED):
    """(the View, its Layers) of a slanted, patterned wall, by closed form, after motions of the rig and of the
    projector in its own frame."""
    normal = np.array([0.35, -0.2, -1.0]) / np.linalg.norm([0.35, -0.2, -1.0])
    to_camera = np.linalg.inv(camera)
    n, there = to_camera[:3, :3] @ normal, transform(to_camera, np.array([0.0, 0.0, 0.7]))
    x, y = view.rays()
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    points = (n @ there / (rays @ n))[..., None] * rays
    on_wall = transform(camera, points)
    albedo = 0.5 + 0.2 * np.sin(GRAIN * on_wall[..., 0]) * np.cos(GRAIN * on_wall[..., 1])
    to_projector = np.linalg.inv(projector) @ view.camera_to_projector
    q = points - np.linalg.inv(to_projector)[:3, 3]
    square = (q * q).sum(-1)
    p, K = transform(to_projector, points), view.projector_K
    u = K[0, 0] * p[..., 0] / p[..., 2] + K[0, 2]
    v = K[1, 1] * p[..., 1] / p[..., 2] + K[1, 2]
    flat = albedo * -(q @ n) / square**1.5 / np.pi
    direct = flat * (0.5 + 0.4 * np.sin(WAVE * u) * np.cos(WAVE * v))
    moved = replace(
        view, depth_m=points[..., 2], normal=np.broadcast_to(n, points.shape), camera_to_projector=to_projector
    )
    zero = np.zeros(view.shape)
    return moved, Layers(direct, zero, albedo, flat, points[..., 2], moved.normal, zero.astype(np.uint32))


def test_slopes_are_those_of_a_wall_by_closed_form():
    frame = replace(example_view("left").frame, exposure_s=1.0, gain=1.0, projector_power=1.0, ambient=None)
    v, u = np.mgrid[0:400, 0:600]
    pattern = (0.5 + 0.4 * np.sin(WAVE * u) * np.cos(WAVE * v)).astype(np.float32)
    K = np.array([[300.0, 0.0, 300.0], [0.0, 300.0, 200.0], [0.0, 0.0, 1.0]])
    view, layers = seen(replace(example_view("left"), frame=frame, pattern=pattern, projector_K=K))
    shot = MeasuredImage(frame, "left", view, layers, layers.direct)
    for nuisances, light in ((Nuisances(1.0, 0.0, 0.0), "direct"), (Nuisances(0.0, 1.0, 0.0), "ambient")):
        slopes = derivatives_in_dn([shot], nuisances, geometry_slopes)[shot.key]
        for number, slope in enumerate(slopes):
            step = 1e-4 * np.eye(TWIST)[number % TWIST]
            which = "projector" if number < TWIST else "camera"
            there, back = (getattr(seen(view, **{which: motion_of_twist(s)})[1], light) for s in (step, -step))
            truth = (there - back)[2:-2, 2:-2] / 2e-4
            assert np.std(slope[2:-2, 2:-2] - truth) <= 0.06 * np.std(truth) + 1e-6, (light, number)


def stated_wrong(capture):
    """The capture with its first pose and its projector not where they are."""
    first, rig = capture.frames[0].camera_to_world, capture.rig
    wrong = first @ np.linalg.inv(motion_of_twist(POSE))
    at_first = [(f.camera_to_world == first).all() for f in capture.frames]
    poses = (wrong if is_first else f.camera_to_world for f, is_first in zip(capture.frames, at_first, strict=True))
    frames = tuple(replace(f, camera_to_world=pose) for f, pose in zip(capture.frames, poses, strict=True))
    projector = replace(rig.projector, left_to_projector=motion_of_twist(PROJECTOR) @ rig.projector.left_to_projector)
    return replace(capture, rig=replace(rig, projector=projector), frames=frames, uncertainty=ROUGH)


def displacement_px(twist):
    """By how much a twist moves what stands half a metre before a camera of 100 pixels' focal length, on average."""
    v, u = np.mgrid[-0.4:0.5:0.2, -0.4:0.5:0.2]
    points = 0.5 * np.stack([u, v, np.ones_like(u)], axis=-1)
    moved = twist[:3] + np.cross(twist[3:], points)
    across = (moved[..., :2] - points[..., :2] / 0.5 * moved[..., 2:]) / 0.5
    return 100.0 * np.sqrt((across**2).sum(-1).mean())


@pytest.fixture(scope="module")
def capture(lab_world):
    return read_capture(lab_world.capture_path)


def remembering(world, cache):
    """A function that renders captures. A RememberingRenderer knows views by their poses, and no projector's."""
    return partial(render_frames, renderer=RememberingRenderer(WorldRenderer(world, grid=3)), cache=cache)


@pytest.fixture
def render(lab_world, lab_cache):
    return remembering(lab_world, lab_cache)


@pytest.fixture(scope="module")
def found(capture, lab_world, lab_cache):
    """The Evidence of a capture that is stated wrong, from where it stands."""
    render = remembering(lab_world, lab_cache)
    return gather_where_it_stands(stated_wrong(capture), render, Model(), memory=lab_cache)


def test_what_stands_elsewhere_is_found_and_told(found):
    geometry = found.geometry
    for corrected, truth in ((geometry.poses[0], POSE), (geometry.projector, PROJECTOR)):
        assert displacement_px(corrected - truth) < 0.4 * displacement_px(truth)
    assert max(map(displacement_px, geometry.poses[1:])) < 0.4 * displacement_px(POSE)
    told = geometry_json(geometry)
    assert {"projector", "view"} <= {entry["what"] for entry in told}
    assert all(
        "than the capture says" in words or "where the capture says" in words
        for words in geometry_words({"geometry": told})
    )


def test_where_it_stands_is_not_searched_again(capture, found, lab_world, lab_cache):
    captures = []

    def render(capture):
        captures.append(capture)
        return render_frames(capture, WorldRenderer(lab_world, grid=3), cache=lab_cache)

    capture = stated_wrong(capture)
    again = gather_where_it_stands(capture, render, Model(), memory=lab_cache)
    assert (again.geometry.twists() == found.geometry.twists()).all()
    assert (again.geometry.deviations == found.geometry.deviations).all()
    assert [c.rig.projector.left_to_projector.tolist() for c in captures] == [
        found.capture.rig.projector.left_to_projector.tolist()
    ]


def test_a_search_goes_on_where_one_more_material_is_seen(found):
    def located(model, near, at_most):
        train = (replace(o, geometry_places=o.geometry_places + 1) for o in near.train)
        return replace(near, train=tuple(train), materials=near.materials + 1), None

    gain = builtin()["gain_mismatch"]
    brighter = (replace(o, measured=o.measured * (1.2 if o.view.is_right else 1.0)) for o in found.train)
    outcome = Search(replace(found, train=tuple(brighter)), Model(), [gain], Settings(located=located)).run()
    assert [name.id for name in outcome.names] == [gain.id]
    assert outcome.evidence.materials == found.materials + 1


def test_a_capture_that_stands_as_stated_is_left_as_it_is(capture, render):
    evidence = gather_where_it_stands(capture, render, Model())
    assert evidence.capture is capture and geometry_json(evidence.geometry) == []


def test_a_search_that_went_astray_begins_again_where_the_capture_is_stated(capture, render):
    """As one does that took an effect for geometry, before the effect was named."""
    stated = Geometry.as_stated(capture)
    astray = stated.moved(stated.focal, np.append(5.0 * PROJECTOR, stated.poses))
    near = gather(astray.capture(), render(astray.capture()), geometry=astray)
    assert gather_where_it_stands(capture, render, Model(), near=near).geometry.is_as_stated()
    with pytest.raises(GivenUp):
        gather_where_it_stands(capture, render, Model(), near=near, at_most=0.5)


def test_a_test_view_is_found_after_all_else_and_moves_nothing_else(capture, lab_world, lab_cache):
    first = capture.frames[0].camera_to_world
    held = [replace(f, split="test" if (f.camera_to_world == first).all() else "train") for f in capture.frames]
    wrong = first @ np.linalg.inv(motion_of_twist(POSE))
    frames = tuple(replace(f, camera_to_world=wrong) if f.split == "test" else f for f in held)
    capture = replace(capture, frames=frames, uncertainty=ROUGH)
    renderer = RememberingRenderer(WorldRenderer(lab_world, grid=3))

    def render(capture, split="train"):
        return render_frames(capture, renderer, cache=lab_cache, frames=capture.split(split))

    evidence = gather_where_it_stands(capture, render, Model())
    assert evidence.test == () and np.abs(evidence.geometry.poses[0]).max() < 1e-12  # nothing measures it
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    solution = fitted_model(fitter, Model(), fitter.phi0(evidence.nuisances))
    found = with_test_frames(evidence, fitter, solution, Model(), partial(render, split="test")).geometry
    assert displacement_px(found.poses[0] - POSE) < 0.4 * displacement_px(POSE)
    assert (found.poses[1:] == evidence.geometry.poses[1:]).all()
    assert (found.projector == evidence.geometry.projector).all()


def render_never(capture):
    raise AssertionError("nothing has to be rendered again")


def hiding(capture, hidden, lab_world, lab_cache):
    """The Evidence of a capture whose images a model changes."""
    layers = render_frames(capture, RememberingRenderer(WorldRenderer(lab_world, grid=3)), cache=lab_cache)
    evidence = gather(capture, layers)

    def seen(o, model):
        return model.signal(model.light(o.layers, o.view), o.view, evidence.nuisances)

    def bent(observations):
        return tuple(replace(o, measured=o.measured + seen(o, hidden) - seen(o, Model())) for o in observations)

    return replace(evidence, train=bent(evidence.train), test=bent(evidence.test))


def test_a_lens_that_distorts_moves_nothing(capture, lab_world, lab_cache):
    """Beside it, focal lengths and poses would take what they can of it."""
    hidden = Model().with_effect(builtin()["radial_distortion"], k1=-0.04)
    evidence = hiding(capture, hidden, lab_world, lab_cache)
    assert gather_where_it_stands(capture, render_never, Model(), near=evidence).geometry.is_as_stated()


def test_what_only_motion_shows_is_no_move_of_its_view(capture, lab_world, lab_cache):
    """A shutter that the model has stays as it is where a view is searched, though no frame at rest shows it."""
    last = capture.frames[-1].camera_to_world
    velocity = np.array([0.4, 0.0, 0.0, 0.0, 0.8, 0.0])
    moving = [replace(f, camera_velocity=velocity) if (f.camera_to_world == last).all() else f for f in capture.frames]
    capture = replace(capture, frames=tuple(replace(f, split="train") for f in moving))
    hidden = Model().with_effect(builtin()["exposure_desync"], delay_s=0.004)
    evidence = hiding(capture, hidden, lab_world, lab_cache)
    twists = [_step(evidence, model).twists.reshape(-1, TWIST)[1:] for model in (Model(), hidden)]
    without, beside = (displacement_px(own[evidence.geometry.moving()][0]) for own in twists)
    assert beside < 0.5 * without


def test_a_coarse_observation_is_what_a_blurred_camera_sees(capture, lab_world, lab_cache):
    evidence = gather(capture, render_frames(capture, WorldRenderer(lab_world, grid=3), cache=lab_cache))
    o, dim = evidence.train[0], Nuisances(1e3, 30.0, 4.0)  # nothing is clipped
    known = np.ones(o.measured.shape, bool)
    for where in (None, np.where(np.arange(known.shape[1]) < 20, False, known)):
        view = replace(o.view, known=where)
        far = coarse(replace(o, view=view, measured=Model().signal(Model().light(o.layers, view), view, dim)), 2.0)
        expected = Model().signal(Model().light(far.layers, far.view), far.view, dim)
        assert far.measured.ravel()[far.pick] == pytest.approx(expected.ravel()[far.pick], rel=1e-4)
        assert np.std(far.measured) < np.std(o.measured)
        assert where is None or where.ravel()[far.pick].all()


def test_views_are_believed_as_far_as_those_at_rest_were_right(capture):
    geometry = Geometry.as_stated(capture)
    assert geometry.beyond_stated().tolist() == [1.0, 1.0]
    known = geometry.stated.uncertainty
    sigma = np.repeat([3.0 * known.pose_m, 0.5 * known.pose_rad], 3)
    poses = np.where(geometry.moving()[:, None], 0.0, sigma)
    assert replace(geometry, poses=poses).beyond_stated() == pytest.approx([3.0, 1.0])


def test_a_misfit_weighs_up_what_is_stated(found):
    """A likelihood that counts each pixel four times takes a prior half as wide."""
    evidence = found
    tempered = replace(evidence, geometry=replace(evidence.geometry, misfit=4.0 * evidence.geometry.misfit))
    np.testing.assert_allclose(tempered.nuisance_prior().sigma, 0.5 * evidence.nuisance_prior().sigma)
    assert evidence.geometry.misfit == 1.0  # a survey's errors are believed


def test_corrections_add_up_as_motions_do(capture):
    geometry = Geometry.as_stated(capture)
    poses, focal = len(geometry.poses), np.array([0.01, -0.02])
    step = np.concatenate([PROJECTOR, *[POSE] * poses])
    there = geometry.moved(focal, step)
    assert there.moved(1.0 / (1.0 + focal) - 1.0, -step).twists() == pytest.approx(0.0, abs=1e-12)
    moved = there.capture().frames[0].camera_to_world
    assert moved == pytest.approx(geometry.stated.frames[0].camera_to_world @ motion_of_twist(POSE))


def test_a_model_puts_the_views_that_it_was_found_on_where_they_stand(capture, tmp_path):
    stated = capture.frames[0].camera_to_world
    write_model(tmp_path / "model.json", SensorModel(poses=(MeasuredPose(stated, stated @ motion_of_twist(POSE)),)))
    there = calibrated(capture, read_model(tmp_path / "model.json"))
    assert there.frames[0].camera_to_world == pytest.approx(stated @ motion_of_twist(POSE))
    assert (there.frames[-1].camera_to_world == capture.frames[-1].camera_to_world).all()


def test_a_moving_view_that_only_an_effect_could_displace_stays_where_it_is_stated(found):
    stated = found.geometry.stated
    moving = replace(stated.frames[0], camera_velocity=np.full(6, 0.1))
    stated = replace(stated, frames=(moving, *stated.frames[1:]))
    evidence = replace(found, capture=stated, geometry=Geometry.as_stated(stated))
    step = np.zeros(evidence.geometry.twists().shape)
    step[TWIST : 2 * TWIST] = 0.03
    assert _moving_beyond_others(evidence, step).tolist() == [True] + [False] * (len(step) // TWIST - 2)
    step[2 * TWIST :] = 0.02  # the views at rest are off by as much
    assert not _moving_beyond_others(evidence, step).any()


def test_an_uncertainty_is_a_positive_number(lab_world, tmp_path):
    folder = shutil.copytree(lab_world.capture_path, tmp_path / "capture")
    file = folder / "capture.json"
    values = json.loads(file.read_text())
    file.write_text(json.dumps(values | {"uncertainty": {"pose_m": 0.01}}))
    assert read_capture(folder).uncertainty == Uncertainty(pose_m=0.01)
    file.write_text(json.dumps(values | {"uncertainty": {"pose_m": -1.0}}))
    with pytest.raises(CaptureError, match="uncertainty.pose_m: is -1"):
        read_capture(folder)


def test_a_stated_place_that_is_impossible_for_what_is_seen_is_told(capture):
    """20 mm off where the file says 0.1 mm; with 20 mm stated, nothing is impossible."""
    for stated_m, impossible in ((1e-4, True), (0.02, False)):
        geometry = Geometry.as_stated(replace(capture, uncertainty=Uncertainty(projector_m=stated_m)))
        geometry = replace(geometry, projector=np.array([0.02, 0, 0, 0, 0, 0]), deviations=geometry.deviations + 1e-4)
        [entry] = geometry_json(geometry)
        assert entry["text"].startswith("the projector stands 20.0 mm (0.00 degrees) from where the capture says")
        assert entry["text"].endswith(", 200 times its stated uncertainty") == impossible
        steps = next_steps(DIAGNOSIS | {"geometry": [entry]})
        assert any('state a larger "uncertainty"' in step for step in steps) == impossible


def pixel_means(view, focal_px, scale=1, margin_px=0):
    """The picture [height][width], 1 + cos(PHASE x) cos(PHASE y): means over squares, `scale` a pixel's side, margin_px
    pixels beyond the frame."""
    sinc = np.sinc(PHASE / focal_px / scale / (2 * np.pi))
    wave = []
    for size, middle in zip(view.shape, (view.K[1, 2], view.K[0, 2]), strict=True):
        at = (np.arange((size + 2 * margin_px) * scale) + 0.5) / scale - 0.5 - margin_px
        wave.append(sinc * np.cos(PHASE * (at - middle) / focal_px))
    return 1.0 + wave[0][:, None] * wave[1]


@pytest.mark.parametrize(("scale", "error"), [(2, 0.05), (1, 0.5)])
def test_the_slope_along_the_focal_length_is_that_of_finer_images(scale, error):
    view = replace(example_view(), frame=replace(example_view().frame, exposure_s=1.0, gain=1.0))
    focal_px, none = view.K[0, 0], np.zeros(view.shape, np.float32)
    dots = pixel_means(view, focal_px).astype(np.float32)
    layers = Layers(dots, none, none, dots, none, none, none)
    if scale > 1:
        supersampled = pixel_means(view, focal_px, scale, MARGIN_PX).astype(np.float32)
        images = SupersampledImages(
            np.stack([supersampled, 0 * supersampled, 0 * supersampled, supersampled]), scale, MARGIN_PX
        )
        layers = Layers(dots, none, none, dots, none, none, none, supersampled=images)
    shot = MeasuredImage(view.frame, view.side, view, layers, dots)
    slope = derivatives_in_dn([shot], Nuisances(40.0, 0.0, 4.0), focal_slopes)[shot.key]
    step = 1e-4
    truth = 40.0 * (pixel_means(view, focal_px * (1 + step)) - pixel_means(view, focal_px * (1 - step))) / (2 * step)
    assert np.std(slope - truth) < error * np.std(truth)


def card_before_a_wall(view, moved_m, scale=2):
    """The Layers of a camera that moved right: a bright card half a metre away, with a slanted edge, before a wall."""
    row, column = ((np.arange((size + 2 * MARGIN_PX) * scale) + 0.5) / scale - 0.5 - MARGIN_PX for size in view.shape)
    card_m, wall_m = 0.5, 1.0
    edge = 40.3 + 0.37 * row[:, None] - view.K[0, 0] * moved_m / card_m
    covered = np.clip(scale * (edge - column) + 0.5, 0.0, 1.0)
    room = np.stack([0 * covered, 0 * covered, 0.2 + 0.6 * covered, 0 * covered]).astype(np.float32)
    fine = SupersampledImages(room, scale, MARGIN_PX)
    inside = slice(MARGIN_PX * scale, -MARGIN_PX * scale)
    depth_m = np.where(covered > 0.5, card_m, wall_m)[inside, inside][::scale, ::scale]
    normal = np.broadcast_to([0.0, 0.0, -1.0], (*view.shape, 3))
    direct, indirect, ambient, flat = fine.pixels()
    return Layers(direct, indirect, ambient, flat, depth_m, normal, depth_m > 0.7, supersampled=fine)


def test_the_slope_at_an_edge_is_that_of_the_nearer_surface_in_finer_images():
    view = replace(example_view(), frame=replace(example_view().frame, exposure_s=1.0, gain=1.0, ambient=None))
    layers = card_before_a_wall(view, 0.0)
    view = replace(view, depth_m=layers.depth_m, normal=layers.normal)
    shot = MeasuredImage(view.frame, view.side, view, layers, layers.ambient)
    step_m = 0.25 * 0.5 / view.K[0, 0]  # a quarter of a pixel on the card
    truth = sum(side * card_before_a_wall(view, side * step_m).ambient for side in (-1, 1)) / (2.0 * step_m)
    slope = derivatives_in_dn([shot], Nuisances(0.0, 1.0, 0.0), geometry_slopes)[shot.key][TWIST]
    assert slope.sum() == pytest.approx(truth.sum(), rel=0.02)
    assert np.linalg.norm(slope - truth) < 0.4 * np.linalg.norm(truth)


@pytest.fixture(scope="module")
def evidence(capture, lab_world, lab_cache):
    return gather(capture, render_frames(capture, WorldRenderer(lab_world, grid=3), cache=lab_cache))


def reflecting(evidence, factors):
    """The evidence of materials, by index, that reflect so many times what the scene says; and the fit to it."""
    train = []
    for o in evidence.train:
        gain = np.ones(o.measured.shape)
        for index, factor in factors.items():
            gain[o.material == index] = factor
        expected = predict(o.frame, o.layers, LIGHT, 255.0)
        measured = LIGHT.black_dn + gain * (expected - LIGHT.black_dn)
        train.append(replace(o, measured=measured.astype(np.float32)))
    evidence = replace(evidence, train=tuple(train))
    fitter, space = Fitter(train, evidence.nuisance_prior(), evidence.tiles), ParameterSpace.of(Model())
    return evidence, fitter, fitter.refine(space, space.start, fitter.phi0(LIGHT), 8)


@pytest.fixture(scope="module")
def dimmer(evidence):
    return reflecting(evidence, {0: 0.6})


def told_of(evidence, fitter, solution, which, factor, within):
    """Entries told of albedos, which are wrong in one material, by a factor."""
    told = albedo_json(evidence, fitter, solution)
    surface = scene_surfaces(evidence.capture.scene_path)[albedo_surfaces(evidence)[which]]
    assert [entry["material"] for entry in told] == [surface.name]
    assert told[0]["factor"] == pytest.approx(factor, abs=within)
    return told


def test_a_wrong_albedo_is_told_by_name_and_number(dimmer):
    told = told_of(*dimmer, 0, 0.6, 0.03)
    assert geometry_words({"albedos": told}) == [f"{told[0]['text'][0].upper()}{told[0]['text'][1:]}."]
    assert "the scene says" in told[0]["text"]


def test_the_largest_material_is_told_where_all_others_seem_wrong_alike_and_none_that_is_as_stated(evidence):
    told_of(*reflecting(evidence, {-1: 1.5}), -1, 1.5, 0.1)
    assert albedo_json(*reflecting(evidence, {0: 1.05})) == []


@pytest.mark.parametrize("factors, farthest, second", [({0: 0.7}, 10.0, 0.0), ({0: 0.7, 1: 0.7}, 10.0, 10.0)])
def test_a_second_wrong_albedo_is_told_apart_from_one(evidence, factors, farthest, second):
    _, fitter, solution = reflecting(evidence, factors)
    found = [fitter.albedo_sigmas(solution, 0.03, k) for k in (1, 2)]
    np.testing.assert_allclose(found, (farthest, second), atol=1.5)


def test_beside_gloss_an_albedo_is_another_quantity(dimmer):
    evidence, fitter, solution = dimmer
    space = ParameterSpace.of(Model(), builtin()["specular"])
    named = fitter.refine(space, space.start, solution.phi, 0)
    assert albedo_json(evidence, fitter, named) == []


@pytest.mark.parametrize("stated, impossible", [(0.01, True), (0.1, False)])
def test_a_stated_albedo_that_is_impossible_for_what_is_seen_is_told(dimmer, stated, impossible):
    wrong, fitter, solution = dimmer
    wrong = replace(wrong, capture=replace(wrong.capture, uncertainty=Uncertainty(albedo=stated)))
    [entry] = albedo_json(wrong, fitter, solution)
    assert entry["stated_sigmas"] == pytest.approx(0.4 / stated, rel=0.1)
    assert ("times its stated uncertainty" in entry["text"]) == impossible
    steps = next_steps(DIAGNOSIS | {"albedos": [entry]})
    assert any(step.startswith("Measure the albedos again, or state a larger") for step in steps) == impossible


@pytest.mark.parametrize("verdict, sigmas, again", [("unknown", 5, True), ("effect", 5, False), ("effect", 11, True)])
def test_an_improbable_rig_is_to_be_calibrated_again(verdict, sigmas, again):
    entry = {"what": "projector", "text": "t", "stated_sigmas": float(sigmas)}
    steps = next_steps(DIAGNOSIS | {"verdict": verdict, "geometry": [entry]})
    assert any(step.startswith("Calibrate the rig again") for step in steps) == again


def test_no_material_of_a_found_model_reflects_less_than_nothing(dimmer):
    evidence, fitter, solution = dimmer
    phi = solution.phi.copy()
    phi[DENSE] = -1.02
    solution = replace(solution, phi=phi)
    materials = found_model(evidence, Model(), solution, {}).materials
    assert min(fields["ir_albedo_factor"].value for fields in materials.values()) == 0.0
    assert min(entry["factor"] for entry in albedo_json(evidence, fitter, solution)) == 0.0
