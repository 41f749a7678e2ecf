# SPDX-License-Identifier: Apache-2.0
"""The held-out cases are what their keys say: light obeys its laws, hidden effects show, and nothing else does."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from virtual_sensor.held_out import oracle
from virtual_sensor.held_out.caster import closest
from virtual_sensor.held_out.catalogue import CATALOGUE, OUTSIDE, SINGLE, STRENGTHS, WIDER
from virtual_sensor.held_out.depth import device_depth
from virtual_sensor.held_out.files import SURVEY
from virtual_sensor.held_out.lightmap import Lightmap
from virtual_sensor.held_out.scene import draw_scene, texel_spacing
from virtual_sensor.held_out.more import more_frames
from virtual_sensor.held_out.specular import reflected_share
from virtual_sensor.held_out.optics import shading
from virtual_sensor.held_out.case import SIDES, RAY_EFFECTS, Case
from virtual_sensor.held_out.mitsuba_case import NOT_RENDERED, MitsubaCase
from virtual_sensor.cylinder import Cylinder
from virtual_sensor.solids import Box, Sphere
from virtual_sensor.tiles import Tiles

SUPPORT = Path(__file__).resolve().parents[2] / "support"
PRODUCT = {"activestereo", "kuafu", "simsense"}


@pytest.fixture(scope="module")
def case():
    """The scene without errors."""
    return Case(seed=5, hidden={}, scene_errors=0.0)


def pcg64(seed):
    return np.random.Generator(np.random.PCG64(seed))


def test_held_out_cases_share_no_code_with_the_product():
    sensor = SUPPORT / "virtual_sensor"
    own = [sensor / f"{name}.py" for name in ("solids", "cylinder", "tiles", "gltf")]
    for path in [*(sensor / "held_out").glob("*.py"), *own]:
        imported = re.findall(r"^ *(?:from|import) (\w+)", path.read_text(), re.M)
        assert not PRODUCT & {*imported}, path


def test_white_surfaces_under_a_white_sky_vanish():
    solids = (
        Tiles("table", (0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.5, 0.0, 0.0), ((1.0, 1.0), (1.0, 1.0))),
        Sphere("ball", (0.1, 0.15, 0.0), 0.08, 1.0),
        Cylinder("can", (-0.2, 0.1, 0.0), (0.0, 1.0, 0.0), 0.05, 0.1, 1.0),
        Box("box", (0.0, 0.06, -0.25), (0.06, 0.06, 0.06), 0.3, 1.0),
    )
    lightmap = Lightmap(solids, pcg64(1), [0.03, 0.02, 0.02, 0.02])
    np.testing.assert_allclose(lightmap.ambient()[lightmap.exposed], 1.0, atol=0.02)


def test_a_coat_reflects_no_more_light_than_arrives():
    cosines = np.linspace(0.03, 1.0, 30)
    for roughness in (0.1, 0.25, 0.4):
        mirror, varnish = (reflected_share(cosines, f0, roughness) for f0 in (1.0, 0.05))
        assert mirror.max() < 1.001 and mirror.min() > 0.9
        assert varnish[-1] == pytest.approx(0.05, rel=0.02) and (np.diff(varnish) < 0).all()


def test_a_ball_on_the_table_darkens_it_by_the_balls_form_factor():
    """A sphere at height h straight above takes (r / h)^2 of the cosine-weighted sky."""
    ball = Sphere("ball", (0.0, 0.3, 0.0), 0.1, 0.0)
    table = Tiles("table", (0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.5, 0.0, 0.0), ((0.0, 0.0), (0.0, 0.0)))
    lightmap = Lightmap((table, ball), pcg64(2), [0.01, 0.05])
    near = (np.hypot(lightmap.points[:, 0], lightmap.points[:, 2]) < 0.02) & (lightmap.owner == 0)
    assert lightmap.ambient()[near].mean() == pytest.approx(1.0 - (0.1 / 0.3) ** 2, abs=0.004)


@pytest.mark.parametrize("solid", [
    Cylinder("can", (0.1, 0.2, -0.1), (0.0, 1.0, 0.0), 0.06, 0.1, 0.5),
    Cylinder("pipe", (0.0, 0.05, 0.1), (0.8, 0.0, 0.6), 0.05, 0.12, 0.5),
    Sphere("ball", (0.0, 0.1, 0.0), 0.1, 0.5),
])  # fmt: skip
def test_triangles_lie_on_the_closed_form(solid):
    """Rays from far towards the triangles' middles hit the solid within 40 micrometres, from their normal's side."""
    positions, normals, faces = solid.triangles()
    middles, outward = positions[faces].mean(axis=1), normals[faces].mean(axis=1)
    length = np.linalg.norm(outward, axis=1)
    middles, outward = middles[length > 0.5], outward[length > 0.5] / length[length > 0.5, None]
    t, normal, _ = closest((solid,), middles + outward, -outward)
    assert np.abs(t - 1.0).max() < 4e-5
    assert (np.einsum("ij,ij->i", normal, outward) > 0.999).all()


def test_scenes_are_drawn_apart_and_differ():
    first, second = draw_scene(pcg64(1)), draw_scene(pcg64(2))
    assert len(first) == len(texel_spacing(first)) == 7
    assert first[2].centre != second[2].centre


def test_without_a_hidden_effect_nothing_is_left_to_explain(case):
    images = {(f.id, side): case.measured(f, side) for f in case.frames for side in SIDES}
    figures = oracle.errors(case, images)
    for split in ("train", "test"):
        assert figures[split]["ratio"] < 0.03
        assert 1.0 < figures[split]["floor_dn"] < 6.0


@pytest.mark.parametrize("name", [n for n in (*SINGLE, *WIDER, *OUTSIDE) if n not in RAY_EFFECTS])
def test_hidden_effects_on_images_leave_error(case, name):
    hidden = {name: CATALOGUE[name].draw(STRENGTHS.index("strong"), pcg64(3))}
    changed = case.hiding(hidden)
    images = {(frame.id, side): changed.measured(frame, side) for frame in changed.frames for side in SIDES}
    if name in ("row_noise", "quantisation"):  # These are in the images' noise, not in their mean.
        calm = np.std(case.measured(case.frames[2], "left") - case.expected(case.frames[2], "left", {}))
        assert np.std(images[2, "left"] - case.expected(case.frames[2], "left", {})) > 1.5 * calm
    else:
        assert oracle.errors(changed, images)["test"]["ratio"] > 0.5


@pytest.mark.parametrize("name", ["stereo_pitch", "exposure_desync", "subsurface"])
def test_hidden_effects_on_rays_leave_error(case, name):
    hidden = {name: CATALOGUE[name].draw(STRENGTHS.index("strong"), pcg64(3))}
    frame = case.frames[6]
    difference = case.hiding(hidden).expected(frame, "right", hidden) - case.expected(frame, "right", {})
    assert np.sqrt(np.mean(difference**2)) > 1.0


def test_a_tool_is_held_to_the_power_of_cos_that_is_nearest_to_the_true_falloff(case):
    held = oracle.scored_parameters(Case(case.seed, {"vignetting": {"exponent": 4.2}}))["vignetting"]["exponent"]
    falloff, squared_cosine = (shading("left", {"vignetting": {"exponent": n}}, case.rig) for n in (4.2, 2.0))
    ratio = {n: falloff / squared_cosine ** (n / 2) for n in (held, 4.2)}
    assert held < 4.2 and np.std(ratio[held]) < 0.5 * np.std(ratio[4.2])


def test_the_virtual_device_measures_the_distance(case):
    frame = case.frames[0]
    images = [case.measured(frame, side) for side in SIDES]
    depth = device_depth(*images, case.rig.focal_px, case.rig.baseline_m, {})
    truth = case.layers(frame, "left", {}).depth[2::4, 2::4]
    valid = (depth > 0) & (truth > 0)
    assert valid.mean() > 0.7
    error_px = case.rig.focal_px * case.rig.baseline_m * (1 / depth[valid] - 1 / truth[valid])
    assert np.median(np.abs(error_px)) < 0.3
    assert abs(np.median(error_px)) < 0.15


def test_the_simulator_reaches_the_floor_of_a_case_that_hides_nothing(case, tmp_path, device):
    figures = case.capture(tmp_path / "capture", "null")
    assert len(read_capture(tmp_path / "capture").frames) == 8
    scores = compare(tmp_path / "capture", cache=LayerCache(tmp_path / "cache"), samples_per_pixel=64).scores
    for split in ("train", "test"):
        assert scores["ir"][split]["rmse_dn"] < 1.04 * figures[split]["floor_dn"]
    assert scores["fit"]["nuisances"]["projector_scale"] == pytest.approx(case.sensor.projector_scale, rel=0.01)
    assert scores["fit"]["nuisances"]["black_dn"] == pytest.approx(case.sensor.black_dn, abs=0.1)


def test_more_frames_repeat_each_train_view_under_the_change(case):
    more = more_frames(case.frames, {"exposure_factor": 2.0})
    views = [f for f in case.frames if f.split == "train" and f.id != 1]
    assert [f.exposure_s for f in more[8:]] == [2.0 * f.exposure_s for f in views]
    assert [f.id for f in more] == list(range(len(more)))
    elsewhere = more_frames(case.frames, {"views": 2})[len(case.frames) :]
    assert [f.id for f in elsewhere] == [8, 9] and elsewhere[0].timestamp_s > case.frames[-1].timestamp_s
    places = [{f.camera_to_world.tobytes() for f in frames} for frames in (case.frames, elsewhere)]
    assert len(places[1] - places[0]) == 2
    repeated = more_frames(case.frames, {"repeats": 2})
    assert all(f.repeat_group is not None for f in repeated if f.split == "train")
    groups = [f.repeat_group for f in repeated[8:]]
    assert all(groups.count(g) == 2 for g in groups)


def test_the_same_sensor_stands_in_another_scene():
    first = Case(seed=5, hidden={"gain_mismatch": {"gain": 0.1, "offset_dn": 0.0}})
    other = first.in_scene(6)
    assert other.rig is not None and np.array_equal(other.rig.pattern, first.rig.pattern)
    assert (other.sensor, other.hidden) == (first.sensor, first.hidden)
    assert other.solids[2].centre != first.solids[2].centre
    assert all(frame.power > 0 and not frame.is_moving for frame in other.frames)


def test_mitsuba_renders_the_same_world(case):
    """Another renderer's light of a frame: the projector's, what surfaces send on, and the sky's."""
    pytest.importorskip("mitsuba", reason="needs the package mitsuba, and an LLVM library for it")
    other = MitsubaCase(seed=5, hidden={}, scene_errors=0.0, sub=2)
    own = Case(seed=5, hidden={}, scene_errors=0.0, sub=2)
    frame = own.frames[0]
    mine, theirs = (world.layers(frame, "left", {}) for world in (own, other))
    assert theirs.direct.mean() == pytest.approx(mine.direct.mean(), rel=0.005)
    assert np.corrcoef(mine.direct.ravel(), theirs.direct.ravel())[0, 1] > 0.99
    assert theirs.indirect.mean() == pytest.approx(mine.indirect.mean(), rel=0.05)
    assert theirs.sky.mean() == pytest.approx(mine.sky.mean(), rel=0.005)


def test_what_mitsubas_worlds_cannot_show_is_refused():
    for name in NOT_RENDERED:
        assert name in RAY_EFFECTS
    world = MitsubaCase(seed=5, hidden={"haze": {"extinction_per_m": 0.1}}, sub=1)
    with pytest.raises(ValueError, match="Mitsuba's worlds have no haze"):
        world.layers(world.frames[0], "left", world.hidden)


def test_a_capture_states_how_well_it_was_surveyed(tmp_path):
    Case(seed=5, hidden={}, scene_errors=3.0, sub=1).capture(tmp_path / "capture", "case")
    document = json.loads((tmp_path / "capture" / "capture.json").read_text())
    assert document["uncertainty"] == {name: 3.0 * deviation for name, deviation in SURVEY.items()}
