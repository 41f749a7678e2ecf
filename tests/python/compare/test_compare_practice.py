# SPDX-License-Identifier: Apache-2.0
"""compare on captures made by an independent program, against the errors that the program's own right model leaves.

The captures are not in the repository: ACTIVESTEREO_DATA names the folder that holds `captures`, else ../shared beside
the checkout. practice-01 hides nothing; on the others the model lacks one effect, and must be wrong by exactly that.
All nine run where ACTIVESTEREO_FULL is set, else practice-01 alone with a quarter of the samples.
"""

import json
import os
import shutil
from pathlib import Path

import pytest

from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from activestereo.effects import builtin
from activestereo.report.summary import what_is_missed

_ROOT = Path(__file__).resolve().parents[3]
_CAPTURES = Path(os.environ.get("ACTIVESTEREO_DATA") or _ROOT.parent / "shared") / "captures"
_QUICK = "practice-01"


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    build = os.environ.get("ACTIVESTEREO_BUILD")
    return LayerCache(Path(build) / "layers" if build else tmp_path_factory.mktemp("layers"))


@pytest.mark.parametrize("name", [f"practice-0{i}" for i in range(1, 10)])
def test_ir_error_is_the_oracles_within_three_percent(name, cache, tmp_path):
    source = _CAPTURES / name
    if not source.is_dir():
        pytest.skip(f"{source} is absent (set ACTIVESTEREO_DATA)")
    if name != _QUICK and not os.environ.get("ACTIVESTEREO_FULL"):
        pytest.skip("set ACTIVESTEREO_FULL=1 to compare all captures")
    # The tool sees a copy without the answer.
    without_answer = shutil.copytree(source, tmp_path / name, ignore=shutil.ignore_patterns("answer.json"))
    samples_per_pixel = 64 if os.environ.get("ACTIVESTEREO_FULL") else 16
    scores = compare(without_answer, samples_per_pixel=samples_per_pixel, cache=cache).scores
    answer = json.loads((source / "answer.json").read_text())
    oracle = answer["oracle"]["ir_rmse_dn"]
    for split in ("train", "test"):
        assert scores["ir"][split]["rmse_dn"] == pytest.approx(oracle[split]["before"], rel=0.03)
        assert scores["ir"][split]["noise_floor_dn"] == pytest.approx(oracle[split]["floor"], rel=0.03)
    said = " ".join(what_is_missed(scores))
    for hidden in answer["effects"]:
        assert f" {builtin()[hidden['effect']].family}" in said, said
    assert answer["effects"] or "at the noise floor" in said
