# SPDX-License-Identifier: Apache-2.0
"""Numbers that a verdict rests on, kept by diagnose.json: from them it can be passed again under other thresholds."""

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from activestereo.diagnose.findings import BaseChecks, Checks, Explanation, Finding, Ranking, Score
from activestereo.diagnose.thresholds import Thresholds
from activestereo.diagnose.verdict.verdict import is_named, verdict_of
from activestereo.effects.core.judging import Channel

Json = dict[str, Any]
# Of the base's checks, those that verdicts rest on.
_OF_BASE = (
    "structure_reduced_chi2",
    "prior_sigmas",
    "plain_excess_reduced_chi2",
    "unsteady_reduced_chi2",
    "uneven_structure_reduced_chi2",
)


def judging_json(ranking: Ranking, has_floor: bool) -> Json:
    """The numbers of a ranking that its verdict rests on."""
    checks = {name: value for name, value in vars(ranking.base_checks).items() if name in _OF_BASE}
    base = {"chi2": ranking.base.chi2, "white_reduced_chi2": ranking.base.white_reduced_chi2, **checks}
    findings = [
        {
            "effect": f.id,
            "channel": f.channel.value,
            "chi2": f.chi2,
            "repeats_reduced_chi2": f.explanation.repeats_reduced_chi2,
            "score": vars(f.score),
            "checks": vars(f.checks),
        }
        for f in ranking.findings
    ]
    sizes = {"pixels": ranking.pixels, "design_effect": ranking.design_effect, "noise_chi2": ranking.noise_chi2}
    return sizes | {"has_floor": has_floor, "base": base, "findings": findings}


def ranking_under(judging: Mapping[str, Any], thresholds: Thresholds) -> Ranking:
    """The ranking that the numbers stand for, under other thresholds; its order stays as it was. It knows no tiles."""
    base = judging["base"]
    checks = BaseChecks(**{name: base[name] for name in _OF_BASE if name in base})
    stub: Any = SimpleNamespace(chi2=base["chi2"], white_reduced_chi2=base["white_reduced_chi2"])
    sizes = judging["pixels"], judging["design_effect"], judging["noise_chi2"]
    return Ranking(stub, checks, tuple(_findings(judging["findings"])), (), *sizes, thresholds)


def _findings(stored: Sequence[Mapping[str, Any]]) -> list[Finding]:
    out = []
    for entry in stored:
        effect: Any = SimpleNamespace(id=entry["effect"])
        channel = Channel(entry["channel"])
        # Whether there is an expected image decides which threshold of size holds; the fit itself is not kept.
        e = Explanation(
            effect, channel, {}, entry["chi2"], np.zeros(1), repeats_reduced_chi2=entry["repeats_reduced_chi2"]
        )
        out.append(Finding(e, Score(**entry["score"]), Checks(**entry["checks"])))
    return out


def verdict_under(judging: Mapping[str, Any], thresholds: Thresholds) -> tuple[str, str | None]:
    """(verdict, first name or None) of one step under other thresholds; further steps of --greedy cannot be taken
    again."""
    ranking = ranking_under(judging, thresholds)
    verdict = verdict_of(ranking, ranking, judging["has_floor"])
    return verdict, ranking.findings[0].id if is_named(ranking) else None
