# SPDX-License-Identifier: Apache-2.0
"""Effects inside of the engines: what each moves."""

from dataclasses import replace

import kuafu
import numpy as np
import pytest

import simsense
from activestereo.capture.capture import Frame
from activestereo.effects import Model, Parameter, Stage, builtin, effect
from activestereo.effects.core.engine import EngineCamera, EngineInputs, apply_engine
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.engines.capture_inputs import record_key

EFFECTS = builtin()
MAPPED = [e for e in EFFECTS.values() if e.engine is not None]
LEAST_MAPPED = 42


def engine_inputs() -> EngineInputs:
    """A warm rig in front of a world of two materials."""
    frame = Frame(
        id=1,
        left_path=None,
        right_path=None,
        timestamp_s=3.0,
        exposure_s=0.004,
        camera_to_world=np.eye(4),
        split="train",
        gain=2.0,
        temperature_c=45.0,
    )
    k = np.array([[200.0, 0, 79.5], [0, 200.0, 59.5], [0, 0, 1]])
    signal = simsense.signal_preset("neutral") | {"exposure_s": 0.004, "gain": 2.0, "temperature_c": 45.0}
    sides = [EngineCamera(kuafu.Camera(160, 120, k), kuafu.Optics(), dict(signal), right) for right in (False, True)]
    return EngineInputs(
        *sides,
        projector=kuafu.Light(kind="projector", k=k, ir_intensity=1.0),
        pattern=np.eye(120, 160, dtype=np.float32),
        frame=frame,
        new_light=kuafu.Light,
        new_medium=kuafu.Medium,
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
    both = {
        n.removeprefix("left.") for n in names if n.startswith("left.") and n.replace("left.", "right.", 1) in names
    }
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
    assert apply_engine(engine_inputs(), model.effects) == model.outside_engines().effects == model.effects
