# SPDX-License-Identifier: Apache-2.0
"""Image functions against the engines: each effect's difference stays near what the page of effects says."""

import os

import pytest

from activestereo.effects import builtin
from activestereo.effects import known_differences
from activestereo.compare.effect_trials import Trial

EFFECTS = builtin()
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
