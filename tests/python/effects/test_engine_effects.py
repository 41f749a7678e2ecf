# SPDX-License-Identifier: Apache-2.0
"""Effects inside the engines: fields, lamps, units in a room, renders that fail."""

from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift
from activestereo.capture.capture import Frame
from activestereo.compare.effect_trials import trial_capture
from activestereo.effects import Model, Parameter, Stage, View, builtin, effect
from activestereo.effects.core import lamp as module, room_unit
from activestereo.effects.core.descriptor import StartImage
from activestereo.effects.core.engine import EngineCamera, EngineInputs, angles, apply_engine, axes
from activestereo.effects.core.lamp import lamp_pose, lamp_starts, radiance_under
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.room_unit import SeenPoints, SphereMatch, room_unit_starts
from activestereo.effects.engines.capture_inputs import enter_world, record_key
from activestereo.effects.engines.capture_renderer import CaptureRenderer
from effect_worlds import CAMERA_K, PATTERN, POSE, PROJECTOR_K, SIZE, seen, view_of
from virtual_sensor.view import PatternSource, look
from virtual_sensor.world import look_at, table_top

import kuafu
import simsense

EFFECTS = builtin()
MAPPED = [e for e in EFFECTS.values() if e.engine is not None]
LEAST_MAPPED = 42


def engine_inputs() -> EngineInputs:
    """A warm rig in front of a world of two materials."""
    frame = Frame(1, None, None, 3.0, 0.004, np.eye(4), "train", gain=2.0, temperature_c=45.0)
    k = np.array([[200.0, 0, 79.5], [0, 200.0, 59.5], [0, 0, 1]])
    signal = simsense.signal_preset("neutral") | {"exposure_s": 0.004, "gain": 2.0, "temperature_c": 45.0}
    sides = [EngineCamera(kuafu.Camera(160, 120, k), kuafu.Optics(), dict(signal)) for _ in range(2)]
    return EngineInputs(
        *sides,
        projector=kuafu.Light(kind="projector", k=k, ir_intensity=1.0),
        pattern=np.eye(120, 160, dtype=np.float32),
        frame=frame,
        scene_materials=lambda number: kuafu.Material(ir_albedo=0.5, specular=0.0),
        material_count=2,
        bounds_m=((-1.0,) * 3, (1.0,) * 3),
    )


def fields_of(inputs: EngineInputs) -> dict[str, object]:
    """Every engine field by the name that effects have for it. Fields of one camera have that camera's name before
    them."""
    out: dict[str, object] = {
        "pattern": inputs.pattern.tobytes(),
        "medium": record_key(inputs.medium),
        "lights": len(inputs.lights),
        "rig_lights": len(inputs.rig_lights),
        "speckle_of_laser": inputs.speckle_of_laser,
    }
    out |= {f"projector.{name}": value for name, value in record_key(inputs.projector)}
    for name, side in (("left", inputs.left), ("right", inputs.right)):
        for part in ("camera", "optics"):
            out |= {f"{name}.{part}.{field}": value for field, value in record_key(getattr(side, part))}
        out |= {f"{name}.signal.{field}": value for field, value in side.signal.items()}
        out[f"{name}.delay_s"] = side.delay_s
    neutral = dict(record_key(inputs.scene_materials(0)))
    changed = {f"materials.{n}" for m in inputs.materials.values() for n, value in record_key(m) if value != neutral[n]}
    return out | dict.fromkeys(changed, "changed")


def moved_fields(e, values: dict[str, float]) -> set[str]:
    inputs = engine_inputs()
    before = fields_of(inputs)
    e.engine(inputs, **values)
    after = fields_of(inputs)
    names = {name for name in after if after[name] != before.get(name)}
    left = {name.removeprefix("left.") for name in names if name.startswith("left.")}
    both = {name for name in left if f"right.{name}" in names}
    return both | {n for n in names if n.split(".", 1)[-1] not in both or not n.startswith(("left.", "right."))}


def test_every_effect_is_engine_or_says_why_not():
    assert len(MAPPED) >= LEAST_MAPPED
    for e in EFFECTS.values():
        assert (e.engine is None) == bool(e.image_only), f"{e.id}: an effect has engine fields, or says why it has none"


@pytest.mark.parametrize("e", MAPPED, ids=lambda e: e.id)
def test_an_effect_moves_what_it_says(e):
    all_surfaces = {"surfaces": 0.0} if "surfaces" in e.typical_values else {}
    ends = ({p.name: getattr(p, end) for p in e.parameters} for end in ("typical_value", "low", "high"))
    moved = set().union(*(moved_fields(e, values | all_surfaces) for values in ends))
    declared = set(e.engine_fields)
    assert moved <= declared | {f"right.{name}" for name in declared}, f"{e.id} moves more than it says"
    assert declared <= moved, f"{e.id} says more than it moves"


@pytest.mark.parametrize("e", MAPPED, ids=lambda e: e.id)
def test_neutral_parameters_move_nothing(e):
    inputs, untouched = engine_inputs(), engine_inputs()
    apply_engine(inputs, ((e, e.neutral_values),))
    assert fields_of(inputs) == fields_of(untouched)


@pytest.mark.parametrize("fraction", [0.2, 0.9])
def test_a_pane_shows_a_share_of_what_is_behind_it_whatever_its_own_albedo(fraction):
    inputs = engine_inputs()
    EFFECTS["transmission"].engine(inputs, fraction=fraction, behind=0.5, surfaces=0.0)
    pane = inputs.material(0)
    assert pane.ir_albedo * pane.ir_transmission == pytest.approx(fraction)  # glTF colours what goes through
    assert pane.ir_albedo * (1.0 - pane.ir_transmission) == pytest.approx((1.0 - fraction) * 0.5)
    assert pane.ir_transmission_roughness == 0.0 and pane.thin_walled


@pytest.mark.parametrize(("nearness", "kind"), [(0.0, "directional"), (1e-14, "directional"), (1e-3, "point")])
def test_a_lamp_as_far_as_no_number_can_tell_is_a_sun(nearness, kind):
    inputs = engine_inputs()
    values = {"strength": 1.0, "azimuth_rad": 0.3, "elevation_rad": 0.5, "nearness_per_m": nearness}
    EFFECTS["external_light"].engine(inputs, **values)
    assert inputs.lights[-1].kind == kind and np.abs(inputs.lights[-1].light_to_world).max() <= 1e12


def test_an_effect_is_written_once():
    twice = [e.id for e in MAPPED if e.apply.__module__ != engine_effect.__module__]
    assert not twice, "images of an effect with engine fields follow from these fields"


def test_a_users_effect_may_have_engine_fields_as_well():
    parameters = [Parameter("fraction", "1", neutral=0.0, low=0.0, high=0.3, typical=0.05)]
    descriptor = {"stage": Stage.OPTICS, "family": "glare", "source": "a bench", "parameters": parameters}

    @engine_effect("filter_haze", moves=("optics.veiling_glare_fraction",), **descriptor)
    def filter_haze(inputs, fraction):
        """Stray light."""
        for side in inputs.sides:
            side.optics.veiling_glare_fraction = fraction

    @effect("stray", **descriptor)
    def stray(image, view, fraction):
        """Stray light without an engine."""
        return image

    inputs = engine_inputs()
    model = Model().with_effect(filter_haze, fraction=0.1).with_effect(stray, fraction=0.2)
    left = apply_engine(inputs, model.effects)
    assert [e.id for e, _ in left] == ["stray"]
    assert inputs.right.optics.veiling_glare_fraction == pytest.approx(0.1)


def test_a_wrong_engine_function_is_refused():
    with pytest.raises(ValueError, match="the function takes"):

        @engine_effect("wrong", moves=("pattern",), stage=Stage.OPTICS, family="x", source="x", parameters=[])
        def wrong(inputs, other):
            """Wrong."""


def test_a_field_that_kuafu_lacks_is_an_error():
    def in_engine(inputs, fraction):
        inputs.left.optics.sparkle = 1.0

    wrong = replace(EFFECTS["veiling_glare"], engine=in_engine)
    with pytest.raises(AttributeError, match="sparkle"):
        apply_engine(engine_inputs(), ((wrong, wrong.typical_values),))


def test_an_image_function_acts_where_engines_lack_a_value():
    model = Model().with_effect(EFFECTS["subsurface"], fraction=0.5, core=0.3)
    assert apply_engine(engine_inputs(), model.effects) == model.effects


def test_after_a_failed_render_the_next_one_is_as_if_it_had_not_been(tmp_path, monkeypatch):
    capture = trial_capture(tmp_path)
    effect = builtin()["specular"]
    model = Model().with_effect(effect, **effect.typical_values)
    renderer = CaptureRenderer("cpu", 1, 1)
    before = {key: light.ambient for key, light in CaptureRenderer("cpu", 1, 1).lights(capture, Model()).items()}

    @contextmanager
    def left_changed(scene, inputs):
        enter_world(scene, inputs)
        yield
        raise RuntimeError("the scene is inside another call")

    with monkeypatch.context() as patch:
        patch.setattr("activestereo.effects.engines.capture_renderer.changed_world", left_changed)
        with pytest.raises(RuntimeError):
            renderer.lights(capture, model)
    for key, light in renderer.lights(capture, Model()).items():
        assert np.array_equal(light.ambient, before[key])


SHAPE = (48, 80)


def room():
    """(points, normals) of a floor and a wall behind it, in camera axes that are the world's."""
    across, along = np.meshgrid(np.linspace(-1.2, 1.2, SHAPE[1]), np.linspace(-1.0, 1.0, SHAPE[0]))
    on_floor = (along < 0.0)[..., None]
    floor, wall = (across, np.full(SHAPE, -0.3), 0.8 + along), (across, along, np.full(SHAPE, 0.8))
    points = np.where(on_floor, np.stack(floor, -1), np.stack(wall, -1))
    return points, np.where(on_floor, [0.0, 1.0, 0.0], [0.0, 0.0, -1.0])


def test_a_lamp_in_the_room_is_sought_where_it_may_stand(monkeypatch):
    """Light falls off beside a near lamp, of which the normals of two surfaces tell nothing."""
    points, normal = room()
    facing = module.Facing.__new__(module.Facing)
    vars(facing).update(points=points, normal=normal, hit=np.ones(SHAPE, bool))
    monkeypatch.setattr(module.Facing, "of", lambda *_: facing)
    for part in (module, room_unit):
        monkeypatch.setattr(part, "reflectance_of", lambda *_: np.full(SHAPE, 0.2))
    frame, unshadowed = SimpleNamespace(camera_to_world=np.eye(4)), lambda *_, choice: np.ones(SHAPE)
    view = SimpleNamespace(left_to_camera=np.eye(4), frame=frame, latest=unshadowed)
    light = SimpleNamespace(ambient=np.full(SHAPE, 0.1))

    def shown(azimuth_rad, elevation_rad, nearness_per_m):
        pose = lamp_pose(azimuth_rad, elevation_rad, nearness_per_m)
        kind = "point" if nearness_per_m else "directional"
        lamp = SimpleNamespace(kind=kind, ir_intensity=np.pi)
        return radiance_under(lamp, pose, light, view)

    truth = {"azimuth_rad": 2.0, "elevation_rad": 0.7, "nearness_per_m": 0.9}
    residual = 40.0 * 1.5 * shown(*truth.values())

    def left_by(start):
        place = shown(*(start.get(name, 0.0) for name in truth))
        columns = np.stack([place.ravel(), np.ones(place.size)])
        found = np.linalg.lstsq(columns.T, residual.ravel(), rcond=None)[0]
        return np.mean((residual.ravel() - found @ columns) ** 2) / np.var(residual)

    starts = lamp_starts([StartImage(view, light, np.ones(SHAPE), residual, residual, 40.0, residual)])
    assert min(map(left_by, starts)) < 0.05 < min(map(left_by, starts[:2]))


UNIT = look_at((0.45, 0.5, 0.45), (0.0, 0.05, -0.25))
AMBIENT_DN, INTENSITY_M2 = 50.0, 6.0


def image_of(pose, noise_share):
    """The image of the unit alone that a rig at a pose sees, as the residual, with noise of a share of the dots'
    deviation."""
    light, geometry = seen("left", left_to_world=pose, bounces=0)
    view: View = view_of(geometry, "left")
    view = replace(view, frame=replace(view.frame, camera_to_world=pose, projector_power=0.0))
    source = PatternSource(UNIT[:3, 3], UNIT[:3, :3], PROJECTOR_K, PATTERN)
    added = AMBIENT_DN * INTENSITY_M2 * look(table_top(), SIZE, CAMERA_K, pose, source, seed=3, grid=4).direct
    noise_dn = noise_share * added.std()
    noise = np.random.default_rng(1).normal(0.0, noise_dn, added.shape)
    weight = np.full(added.shape, noise_dn**-2)
    ambient = AMBIENT_DN * light.ambient
    return StartImage(view, light, weight, added + noise, ambient, AMBIENT_DN, ambient), noise


@pytest.fixture(scope="module")
def images():
    poses = [POSE, look_at((-0.15, 0.45, 0.5), (0.0, 0.06, -0.2)), look_at((0.3, 0.35, 0.45), (0.0, 0.06, -0.2))]
    return [image_of(pose, 0.5) for pose in poses]


def test_a_place_shows_which_way_a_unit_there_points(images):
    chosen = [image for image, _ in images]
    seen = SeenPoints.of(chosen, 6000)
    match = SphereMatch(chosen[0].view, *room_unit.COARSE)
    (gain, pose), (beside, _) = match.best(seen, np.stack([UNIT[:3, 3], UNIT[:3, 3] + (0.2, 0.0, 0.0)]))
    np.testing.assert_allclose(pose[3:5], angles(UNIT[:3, 2]), atol=0.03)
    assert gain > 3 * beside
    even = replace(chosen[0].view, pattern=np.ones_like(chosen[0].view.pattern))
    assert SphereMatch(even, *room_unit.COARSE).best(seen, UNIT[None, :3, 3])[0][0] < 1e-3 * gain


def test_the_pose_is_found_from_the_dots(images, monkeypatch):
    # This unit lights most of the picture: few places are likelier than its own.
    monkeypatch.setattr(room_unit, "_PLACES", 250)
    found = room_unit_starts([image for image, _ in images])[0]
    np.testing.assert_allclose([found[name] for name in ("x_m", "y_m", "z_m")], UNIT[:3, 3], atol=0.05)
    turn = axes(found["azimuth_rad"], found["elevation_rad"], found["roll_rad"])
    assert turn[:, 2] @ UNIT[:3, 2] > np.cos(0.06)
    assert found["intensity_m2"] == pytest.approx(INTENSITY_M2, rel=0.4)


def test_errors_of_the_rigs_own_dots_do_not_hide_a_unit(images, monkeypatch):
    monkeypatch.setattr(room_unit, "_PLACES", 250)

    def lit(image):
        """The image where the rig's projector is on, with errors of its dots five times as large as the unit's."""
        own = np.random.default_rng(5).gamma(0.2, 1.0, image.residual.shape)
        wrong = 5.0 * image.residual.std() * (own - own.mean()) / own.std()
        view = replace(image.view, frame=replace(image.view.frame, projector_power=1.0))
        return replace(image, view=view, residual=image.residual + wrong)

    (dark, _), *others = images
    found = room_unit_starts([*(lit(image) for image, _ in others), dark])[0]
    assert [found.get(name) for name in ("x_m", "y_m", "z_m")] == pytest.approx(UNIT[:3, 3].tolist(), abs=0.05)


def test_nothing_is_searched_in_noise_alone(images):
    assert room_unit_starts([replace(image, residual=noise) for image, noise in images]) == [{}]


def test_nothing_is_searched_in_the_noise_of_smooth_light_that_the_model_lacks(images, monkeypatch):
    monkeypatch.setattr(room_unit, "_likely_places", None)  # may not be asked

    def under_lamp(image):
        """The image with speckle of a tenth of all light, under a lamp that the model lacks."""
        before = np.full(image.residual.shape, 40.0)
        speckle = 0.1 * np.random.default_rng(2).normal(size=before.shape)
        lamp = np.linspace(0.0, 60.0, before.shape[1])
        return replace(image, residual=lamp + speckle * (before + lamp), expected=before, weight=(0.1 * before) ** -2)

    assert room_unit_starts([under_lamp(image) for image, _ in images]) == [{}]


def test_nothing_is_searched_in_detail_that_follows_the_models_own_dots(images, monkeypatch):
    """Blurred, moved and too bright dots of the rig are no unit's."""
    monkeypatch.setattr(room_unit, "_likely_places", None)  # may not be asked

    def misplaced(image, noise):
        dots = image.residual - noise
        wrong = 1.2 * shift(gaussian_filter(dots, 0.6), (0.0, 0.3), order=1, mode="nearest") - dots
        assert np.mean(image.weight * wrong**2) > 0.1  # its detail is well above the noise
        return replace(image, residual=wrong + noise, expected=image.expected + dots)

    assert room_unit_starts([misplaced(*image) for image in images]) == [{}]


def test_axes_and_angles_are_those_of_a_pose_that_looks_along_the_beam():
    np.testing.assert_allclose(axes(*angles(UNIT[:3, 2]), 0.0), UNIT[:3, :3], atol=1e-12)


def test_the_formula_draws_the_dots_where_a_source_there_throws_them(images):
    image, noise = images[0]
    azimuth, elevation = angles(UNIT[:3, 2])
    x, y, z = UNIT[:3, 3]
    lit = builtin()["room_projector"](
        image.light, image.view, intensity_m2=INTENSITY_M2, x_m=x, y_m=y, z_m=z, azimuth_rad=azimuth,
        elevation_rad=elevation, roll_rad=0.0,
    )  # fmt: skip
    added, truth = AMBIENT_DN * (lit.ambient - image.light.ambient), image.residual - noise
    here = (truth > 0) & (image.light.flat > 0)
    assert np.corrcoef(added[here], truth[here])[0, 1] > 0.9
