# SPDX-License-Identifier: Apache-2.0
"""Images that the engine predicts under a model, and the image functions beside them."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from activestereo.capture.capture import Capture, read_capture
from activestereo.capture.images import read_gray
from activestereo.capture.write import write_capture
from activestereo.cli import main
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from activestereo.compare.effect_trials import Trial, trial_capture
from activestereo.compare.engine_prediction import engine_changes, kept_lights
from activestereo.compare.nuisances import Nuisances
from activestereo.effects import Light, Model, View, builtin, known_differences
from activestereo.effects.core.view import Layers
from activestereo.effects.engines import CaptureRenderer, SceneMeasurement
from activestereo.model import Quantity, diagnosed_model, write_model
from command_line import refused

EFFECTS = builtin()
SAMPLES, BOUNCES, NOISE_DN = 8, 1, 1.0
NUISANCES = Nuisances(projector_scale=120000.0, ambient_scale=9000.0, black_dn=5.0)
HIDDEN = {
    "vignetting": {"exponent": 2.0},
    "response_gamma": {"log_exponent": 0.15},
    "principal_point_offset": {"cx_px": 1.0, "cy_px": 0.0},
}
SCENE_MEASUREMENT = SceneMeasurement((0.002, 0.002), {1: 1.1})


def model_of(**effects: dict[str, float]) -> Model:
    model = Model()
    for name, values in effects.items():
        model = model.with_effect(EFFECTS[name], **values)
    return model


@pytest.fixture(scope="module")
def nominal(tmp_path_factory) -> Capture:
    """A capture without images: half the size of the trial world's, its second frame held out."""
    capture = trial_capture(tmp_path_factory.mktemp("trial"), scale=0.5)
    first, second = capture.frames
    return replace(capture, frames=(first, replace(second, split="test")))


@pytest.fixture(scope="module")
def renderer() -> CaptureRenderer:
    return CaptureRenderer(samples_per_pixel=SAMPLES, max_bounces=BOUNCES, seed=3)


@pytest.fixture(scope="module")
def hidden(nominal, renderer, tmp_path_factory) -> Path:
    """The measurement of a sensor with the hidden effects."""
    expected = renderer.expected(nominal, model_of(**HIDDEN), NUISANCES, scene_measurement=SCENE_MEASUREMENT)
    rng = np.random.default_rng(1)
    images = {
        key: np.clip(np.rint(dn + NOISE_DN * rng.standard_normal(dn.shape)), 0, 255).astype(np.uint8)
        for key, dn in expected.items()
    }
    folder = tmp_path_factory.mktemp("hidden") / "capture"
    write_capture(folder, nominal, images, read_gray(nominal.rig.projector.pattern_path))
    return folder


def rmse_of(hidden: Path, model: Model, scene_measurement: SceneMeasurement | None = None) -> float:
    engines = lambda capture: CaptureRenderer(samples_per_pixel=SAMPLES, max_bounces=BOUNCES)  # noqa: E731
    options = {"samples_per_pixel": SAMPLES, "max_bounces": BOUNCES, "scene_measurement": scene_measurement}
    comparison = compare(hidden, model, engines=engines, **options)
    return comparison.scores["ir"]["test"]["rmse_dn"]


def test_the_true_model_leaves_the_noise(hidden):
    floor = np.hypot(NOISE_DN, np.sqrt(1 / 12))
    assert rmse_of(hidden, Model()) > 4 * floor
    # The renderer's own noise differs between the seeds.
    assert rmse_of(hidden, model_of(**HIDDEN), SCENE_MEASUREMENT) < 1.5 * floor


@pytest.mark.parametrize(
    "effect, values",
    [
        ("specular", {"factor": 1e-5, "roughness": 0.4}),
        ("specular", {"factor": 1e-5, "roughness": 0.15}),
        ("transmission", {"fraction": 1e-5}),
        ("subsurface", {"fraction": 1e-5}),
    ],
)
def test_next_to_no_gloss_changes_next_to_nothing(nominal, renderer, effect, values):
    """Light is filtered with an effect as without it; else the difference would show the edges of surfaces."""
    change = engine_changes(nominal, "auto", 64, BOUNCES, 0)(Model().with_effect(EFFECTS[effect], **values))
    light = kept_lights(nominal, renderer, LayerCache(), Model(), nominal.split("train"))
    for key, images in change.items():
        assert np.square(images).mean() < 1e-3 * np.square(light[key]).mean()


def test_figures_do_not_depend_on_what_lies_in_the_folder(hidden, tmp_path):
    """A diagnose.json in the output folder is shown in the report, and changes no figure."""
    arguments = ["compare", str(hidden), "--spp", "4", "--max-bounces", str(BOUNCES)]
    (tmp_path / "diagnosed").mkdir()
    (tmp_path / "diagnosed" / "diagnose.json").write_text("{}")
    for name in ("empty", "diagnosed"):
        assert main([*arguments, "--out", str(tmp_path / name)]) == 0
    assert (tmp_path / "empty/compare.json").read_bytes() == (tmp_path / "diagnosed/compare.json").read_bytes()


def test_the_command_takes_a_model_with_calibration_and_albedos(nominal, hidden, tmp_path, capsys):
    names = ["table", "wall", "clay", "card"]
    told = {"albedo": {"wall": 1.1}, "material_names": names}
    focal = {"focal_left": 0.002, "focal_right": 0.002}
    samples = ["--spp", str(4 * SAMPLES), "--max-bounces", str(BOUNCES)]
    arguments = ["compare", str(hidden), *samples, "--out", str(tmp_path)]
    rmse_dn = []
    for scene in (({},), (focal,)):
        model = diagnosed_model(read_capture(hidden), model_of(**HIDDEN), *scene, **(told if scene[0] else {}))
        write_model(tmp_path / "model.json", model)
        assert main([*arguments, "--model", str(tmp_path / "model.json")]) == 0
        scores = json.loads((tmp_path / "compare.json").read_text())
        assert scores["effects"] == list(HIDDEN)
        rmse_dn.append(scores["ir"]["test"]["rmse_dn"])
    assert rmse_dn[1] < min(1.6, 0.95 * rmse_dn[0])
    capsys.readouterr()
    lost = model.with_effect(EFFECTS["specular"], {"factor": Quantity(0.1)}, ("jelly",))
    write_model(tmp_path / "lost.json", lost)
    before = shutil.copy(tmp_path / "compare.json", tmp_path / "before.json")
    assert "no material 'jelly'" in refused([*arguments, "--model", tmp_path / "lost.json"], capsys)
    assert (tmp_path / "compare.json").read_bytes() == Path(before).read_bytes()


def test_the_scene_is_as_before_and_what_changes_no_ray_traces_none(nominal, renderer):
    seen = renderer.lights(nominal, Model())
    glossy = renderer.lights(nominal, model_of(specular={"factor": 0.8, "roughness": 0.3}))
    again = CaptureRenderer(samples_per_pixel=SAMPLES, max_bounces=BOUNCES, seed=3).lights(nominal, Model())
    key = (0, "left")
    assert np.abs(glossy[key].direct - seen[key].direct).max() > 0.01 * seen[key].direct.max()
    np.testing.assert_array_equal(renderer.lights(nominal, Model())[key].direct, again[key].direct)
    dim = renderer.lights(nominal, model_of(laser_power_drift={"per_k": -0.01}, gain_mismatch={"gain": 0.1}))
    np.testing.assert_allclose(dim[key].direct, seen[key].direct * np.exp(-0.2), rtol=1e-6)


def test_expected_images_leave_no_effect_out(nominal, renderer):
    with pytest.raises(ValueError, match="ambient_ir, double_image: no engine field"):
        renderer.expected(nominal, model_of(ambient_ir={"level": 0.2}, double_image={"fraction": 0.1}), NUISANCES)


@pytest.mark.parametrize("added", [
    {"external_light": {"strength": 2.0, "azimuth_rad": 0.5, "nearness_per_m": 0.5}},
    {"second_projector": {"intensity_m2": 8.0}},
])  # fmt: skip
def test_light_that_a_model_adds_is_the_difference_of_two_renders(nominal, added):
    renderer, model = CaptureRenderer(samples_per_pixel=64, max_bounces=BOUNCES), model_of(**added)
    plain, more = (renderer.lights(nominal, m) for m in (Model(), model))
    alone = renderer.added_light(nominal, model, nominal.frames)
    for key, image in alone.items():
        np.testing.assert_array_equal(more[key].direct, plain[key].direct)  # it is the room's light
        truth = more[key].ambient - plain[key].ambient
        assert image.mean() == pytest.approx(truth.mean(), rel=0.02)
        assert np.sqrt(np.mean((image - truth) ** 2)) < 0.15 * truth.std()
    # Afterwards the scene has its own light again.
    again = renderer.lights(nominal, Model(), nominal.frames[:1])
    np.testing.assert_array_equal(again[0, "left"].ambient, plain[0, "left"].ambient)


def test_a_projector_in_the_room_stays_where_it_is_when_the_rig_moves(renderer, nominal):
    """The engine's dots are those of the formula, which knows the unit's place in the world, from every pose."""
    unit = {"intensity_m2": 8.0, "azimuth_rad": -2.57, "elevation_rad": -0.5, "roll_rad": 0.1}
    here, elsewhere = (unit | {"x_m": x_m, "y_m": 0.5, "z_m": 0.45} for x_m in (0.45, 0.3))
    plain, more = renderer.lights(nominal, Model()), renderer.lights(nominal, model_of(room_projector=here))
    assert not np.allclose(nominal.frames[0].camera_to_world, nominal.frames[-1].camera_to_world)
    for frame in (nominal.frames[0], nominal.frames[-1]):
        seen = plain[frame.id, "left"]
        layers = Layers(seen.direct, seen.indirect, seen.ambient, seen.direct, seen.depth_m, seen.normal, seen.material)
        view, light = View.of(nominal, frame, "left", layers), Light.of(layers)
        change = _coarse(more[frame.id, "left"].ambient - seen.ambient)
        like = [
            np.corrcoef(change, _coarse(EFFECTS["room_projector"](light, view, **place).ambient - light.ambient))[0, 1]
            for place in (here, elsewhere)
        ]
        assert like[0] > 0.8 and like[0] > like[1] + 0.1


def _coarse(image):
    """Means over 6x6 pixels: of few samples, and of bounced light, too little is left to hide the dots."""
    height, width = (n // 6 for n in image.shape)
    return image[: 6 * height, : 6 * width].reshape(height, 6, width, 6).mean((1, 3)).ravel()


def test_light_that_was_rendered_once_is_taken_from_the_cache(renderer, nominal, tmp_path, monkeypatch):
    cache, model, frames = LayerCache(tmp_path), model_of(radial_distortion={"k1": 0.02}), nominal.frames
    first = kept_lights(nominal, renderer, cache, model, frames, SCENE_MEASUREMENT, half=0)
    rendered = renderer.lights(nominal, model, frames, SCENE_MEASUREMENT, half=0)
    for key, images in first.items():
        np.testing.assert_array_equal(images, [rendered[key].direct, rendered[key].indirect, rendered[key].ambient])

    class Traced(Exception):
        """A ray was traced."""

    def trace(*_, **__):
        raise Traced

    monkeypatch.setattr(CaptureRenderer, "_images", trace)
    moved = replace(frames[0], camera_to_world=frames[0].camera_to_world + np.eye(4)[3] * 1e-4)
    coarse = replace(nominal, rig=replace(nominal.rig, left=replace(nominal.rig.left, K=1.001 * nominal.rig.left.K)))
    like = lambda samples=SAMPLES: CaptureRenderer("auto", samples, BOUNCES, 3)  # noqa: E731
    again = kept_lights(nominal, like(), cache, model, frames, SCENE_MEASUREMENT, half=0)
    assert all(np.array_equal(a, b) for key in first for a, b in zip(first[key], again[key], strict=True))
    wholly = (model, frames, SCENE_MEASUREMENT, None, 0)
    for capture, other, (own, seen, measured, _, half) in (
        (nominal, like(), (model_of(radial_distortion={"k1": 0.021}), *wholly[1:])),
        (nominal, like(), (model, (moved, *frames[1:]), *wholly[2:])),
        (nominal, like(), (model, frames, SceneMeasurement((0.002, 0.001), {1: 1.1}), None, 0)),
        (nominal, like(), (*wholly[:4], 1)),
        (coarse, like(), wholly),
        (nominal, like(SAMPLES + 2), wholly),
    ):
        with pytest.raises(Traced):
            kept_lights(capture, other, cache, own, seen, measured, half=half)


KNOWN = known_differences()
# Samples are drawn independently for each device and version; small differences are all noise.
SLACK, LEAST = 1.3, 0.05
# Every fourth by default, all with ACTIVESTEREO_FULL=1 (about 3 s of a core each).
TRIED = list(KNOWN) if os.environ.get("ACTIVESTEREO_FULL") else list(KNOWN)[::4]


@pytest.fixture(scope="module")
def trial(tmp_path_factory) -> Trial:
    return Trial(tmp_path_factory.mktemp("trial"))


def test_every_mapped_effect_has_a_figure():
    assert set(KNOWN) == {e.id for e in EFFECTS.values() if e.engine is not None}, "effect check --all --out"


@pytest.mark.parametrize("name", TRIED)
def test_the_image_function_is_as_near_to_the_engines_as_told(trial, name):
    assert trial.difference(EFFECTS[name]) < SLACK * KNOWN[name] + LEAST
