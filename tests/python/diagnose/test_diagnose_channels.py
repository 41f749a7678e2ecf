# SPDX-License-Identifier: Apache-2.0
"""Every effect is judged on the channel that its descriptor says: no name of an effect stands in the lab, and a user's
own are judged alike."""

import ast
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import activestereo.lab
from activestereo.cli import main
from activestereo.effects import Randomness, builtin
from activestereo.effects.core.descriptor import Channel, Lever, RandomTerm, Unjudged
from activestereo.diagnose import diagnose
from activestereo.common.text_table import markdown
from activestereo.diagnose.numbers import NUMBERS
from lab_worlds import BLACK_DN, WorldRenderer, altered

EFFECTS = builtin()
LAB = Path(activestereo.diagnose.__file__).resolve().parent


def test_no_effect_is_named_in_the_lab():
    # A room's plan and the spread between its sessions are told by effect.
    for path in (path for path in LAB.rglob("*.py") if path.parent.name != "room"):
        texts = {
            n.value
            for n in ast.walk(ast.parse(path.read_text()))
            if isinstance(n, ast.Constant) and isinstance(n.value, str)
        }
        assert not texts & set(EFFECTS), path


def test_every_built_in_effect_says_how_it_is_judged():
    assert all(e.channel is not None or any(isinstance(j, Unjudged) for j in e.judged) for e in EFFECTS.values())
    static = {e.id for e in EFFECTS.values() if e.channel is Channel.STATIC_FIELD}
    assert static == {e.id for e in EFFECTS.values() if e.randomness is Randomness.STATIC}


def test_a_term_names_a_parameter_of_its_effect():
    with pytest.raises(ValueError, match="judged by a parameter 'sigma'"):
        replace(EFFECTS["read_noise"], judged=(RandomTerm("sigma", Lever.ONE),))


@pytest.fixture(scope="module")
def result(lab_world, lab_cache, tmp_path_factory):
    """A world whose pixels have gains, ranked with effects of a user's: gains by another name, noise, and one without a
    word."""
    rng, gains = np.random.default_rng(3), {}

    def change(dn, side):
        gain = gains.setdefault(side, 1.0 + 0.15 * rng.standard_normal(dn.shape))
        return BLACK_DN + gain * (dn - BLACK_DN)

    capture = altered(lab_world, tmp_path_factory.mktemp("gains") / "capture", change)
    effects = {
        "my_gains": replace(EFFECTS["prnu"], id="my_gains"),
        "my_noise": replace(EFFECTS["read_noise"], id="my_noise"),
        "no_word": replace(EFFECTS["prnu"], id="no_word", judged=()),
    }
    return diagnose(capture, effects=effects, renderer=WorldRenderer(lab_world, grid=3), cache=lab_cache).result


def test_a_users_static_effect_is_ranked_and_found(result):
    first = result["ranking"][0]
    assert (first["effect"], result["verdict"]) == ("my_gains", "effect")
    assert first["parameters"]["sigma"]["value"] == pytest.approx(0.15, rel=0.15)


def test_a_users_temporal_effect_is_ranked(result):
    [noise] = [e for e in result["ranking"] if e["effect"] == "my_noise"]
    assert noise["channel"] == "noise" and noise["parameters"]["sigma_dn"]["value"] >= 0.0


def test_what_cannot_be_ranked_is_listed_with_the_reason(result):
    [skipped] = result["not_ranked"]
    assert skipped["effect"] == "no_word" and "does not say how it is judged" in skipped["reason"]


def test_page_and_help_print_the_numbers_that_decide(capsys):
    rows = [
        (f"`{f.name}`", f"{getattr(NUMBERS, f.name):g}", f.metadata["unit"].strip("1"), f.metadata["decides"])
        for f in fields(NUMBERS)
    ]
    table = "\n".join(markdown(("number", "value", "unit", "decides"), rows))
    assert len(rows) <= 15 and table in (LAB / "README.md").read_text()
    with pytest.raises(SystemExit):
        main(["diagnose", "--help"])
    said = capsys.readouterr().out
    assert f"--alpha {NUMBERS.alpha:g}" in said and f"removes {NUMBERS.least_share:g} of the squared error" in said
