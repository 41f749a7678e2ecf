# SPDX-License-Identifier: Apache-2.0
"""A diagnosis that scores all effects first: it names what a world hides, and names nothing where nothing is hidden."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import activestereo.report
from activestereo.diagnose import diagnose
from activestereo.diagnose.answer.by_scores import ranking_of
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.score.intervals import Interval
from activestereo.diagnose.search.dictionary import carried
from activestereo.diagnose.search.loop import Name, Round
from activestereo.diagnose.search.refit import Refit
from activestereo.diagnose.search.selection import credible
from activestereo.diagnose.search.verdict import EFFECT, NONE, UNDETERMINED, UNKNOWN, Remainder, verdict_of
from activestereo.effects import Parameter, Stage, builtin, effect
from lab_worlds import BLACK_DN, WorldRenderer, altered
from schema_check import violations

FEW = ("projector_vignetting", "radial_distortion", "vignetting", "response_gamma", "gain_mismatch", "prnu")
EFFECTS = {name: e for name, e in builtin().items() if name in FEW}
EXPONENT = 2.0


def shaded(dn, side):
    """Lens shading by cos^EXPONENT, of an image whose focal length is half its width."""
    height, width = dn.shape
    v, u = np.mgrid[0:height, 0:width]
    r2 = ((u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2) / (0.5 * width) ** 2
    return BLACK_DN + (dn - BLACK_DN) * (1.0 + r2) ** (-EXPONENT / 2)


def diagnosed(folder, world, cache, effects=EFFECTS, **more):
    return diagnose(
        folder, effects=effects, renderer=WorldRenderer(world, grid=3), cache=cache, scores_first=True, **more
    )


@pytest.fixture(scope="module")
def hidden_shading(lab_world, lab_cache, tmp_path_factory):
    folder, words = altered(lab_world, tmp_path_factory.mktemp("shading") / "capture", shaded), []
    return folder, words, diagnosed(folder, lab_world, lab_cache, looks_like=words.extend)


def test_a_hidden_lens_shading_is_named_with_its_exponent(hidden_shading):
    _, words, diagnosis = hidden_shading
    first = diagnosis.result["ranking"][0]
    assert (diagnosis.result["verdict"], diagnosis.result["added"]) == ("effect", ["vignetting"])
    assert words[0] == first["effect"] == "vignetting"
    found = first["parameters"]["exponent"]
    assert found["value"] == pytest.approx(EXPONENT, rel=0.1) and found["low"] < EXPONENT < found["high"]


def test_its_set_holds_it_alone_and_probabilities_add_up(hidden_shading):
    result = hidden_shading[2].result
    assert [s["effects"] for s in result["sets"]] == [["vignetting"]]
    given = result["probabilities"]
    assert sum(given["named"].values()) + given["none"] + given["something_else"] == pytest.approx(1.0)


def test_files_keep_the_schema(hidden_shading):
    schema = json.loads((Path(activestereo.report.__file__).parent / "schema" / "diagnose.schema.json").read_text())
    assert violations(json.loads(json.dumps(hidden_shading[2].result)), schema) == []


def test_nothing_is_named_where_nothing_is_hidden(lab_world, lab_cache):
    result = diagnosed(lab_world.capture_path, lab_world, lab_cache).result
    assert (result["verdict"], result["added"], result["sets"]) == ("none", [], [])


def test_pixel_gains_are_a_variance_component(lab_world, lab_cache, tmp_path):
    rng, gains = np.random.default_rng(3), {}

    def change(dn, side):
        gain = gains.setdefault(side, 1.0 + 0.15 * rng.standard_normal(dn.shape))
        return BLACK_DN + gain * (dn - BLACK_DN)

    folder = altered(lab_world, tmp_path / "capture", change)
    effects = {name: e for name, e in builtin().items() if name in (*FEW, "fixed_pattern_noise", "hot_pixels")}
    first = diagnosed(folder, lab_world, lab_cache, effects).result["ranking"][0]
    assert first["effect"] == "prnu"
    assert first["parameters"]["sigma"]["value"] == pytest.approx(0.15, rel=0.15)


def test_an_own_effect_of_a_few_lines_is_ranked(hidden_shading, lab_world, lab_cache):
    amount = Parameter("amount", "1", neutral=0.0, low=0.0, high=3.0, typical=0.5)

    @effect("my_shading", stage=Stage.OPTICS, family="mine", source="my bench", parameters=[amount])
    def my_shading(image, view, amount):
        """The corners are darker."""
        x, y = view.field()
        return image * (1.0 + x**2 + y**2) ** -amount

    own = diagnosed(hidden_shading[0], lab_world, lab_cache, EFFECTS | {"my_shading": my_shading}).result
    assert "my_shading" in own["own"] and "my_shading" in {entry["effect"] for entry in own["ranking"]}


def test_without_test_frames_the_figures_are_of_frames_left_out(hidden_shading, lab_world, lab_cache, tmp_path):
    folder = shutil.copytree(hidden_shading[0], tmp_path / "capture")
    root = json.loads((folder / "capture.json").read_text())
    root["frames"] = [frame for frame in root["frames"] if frame.get("split", "train") == "train"]
    (folder / "capture.json").write_text(json.dumps(root))
    result = diagnosed(folder, lab_world, lab_cache).result
    before, after, floor = (
        result[key] for key in ("heldout_ir_rmse_before", "heldout_ir_rmse_after", "heldout_noise_floor")
    )
    assert before > after > 0.8 * floor


def test_the_answer_is_an_object_to_work_with(hidden_shading):
    _, _, diagnosis = hidden_shading
    frame = diagnosis.before.capture.frames[0].id
    assert np.abs(diagnosis.residual(frame)).mean() < np.abs(diagnosis.before.residuals()[frame, "left"]).mean()
    assert diagnosis.predict(frame).shape == diagnosis.residual(frame).shape
    assert diagnosis.sets() == [["vignetting"]]
    assert "and was named" in diagnosis.explain("vignetting")
    assert "vignetting explains" in diagnosis.explain("projector_vignetting")
    assert diagnosis.explain("haze") == "haze explains next to nothing of the images"
    assert len(diagnosis.plot().axes[0].patches) > 0


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
        noise={"vignetting": SimpleNamespace(effect=vignetting, own=None, parameters=found)},
        first=fitted("vignetting", 200.0),
        solution=fitted("vignetting", 100.0),
        fitter=SimpleNamespace(
            observations=[SimpleNamespace(pixels=100)], pixels=lambda: [SimpleNamespace(tile=np.arange(100) % 4)]
        ),
        evidence=SimpleNamespace(tiles=4),
        rest=Remainder(1.0, 0.0, 0.0, 1.0),
    )
    twin = ranking_of(outcome, NUMBERS, True, str)[1]
    assert (twin["effect"], twin["equivalent"]) == ("projector_vignetting", ["vignetting"])
    assert twin["gain_reduced_chi2"] == pytest.approx((150.0 - 110.0) / 100)


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
        (Remainder(0.8, 0.02, 0.01, 0.6), True, False, EFFECT),
        (Remainder(0.8, 0.4, 0.2, 0.6), True, True, UNKNOWN),
        (Remainder(0.2, 0.4, 0.0, 0.1), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, strain=5.0), True, True, UNKNOWN),
    ],
)
def test_the_verdict_follows_from_what_is_explained_and_left(rest, named, floor, verdict):
    assert verdict_of(rest, named, floor, NUMBERS) == verdict


def test_a_set_ends_where_it_holds_its_mass():
    assert list(credible({"a": 0.0, "b": -0.1, "c": -9.0}, 0.95)) == ["a", "b"]
    assert list(credible({"a": 0.0, "b": -9.0}, 0.95)) == ["a"]


def test_at_most_fifteen_numbers_decide():
    assert len(vars(NUMBERS)) <= 15
