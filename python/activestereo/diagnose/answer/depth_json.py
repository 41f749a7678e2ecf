# SPDX-License-Identifier: Apache-2.0
"""Writes the judgement of a depth engine as diagnose.json holds it."""

from collections.abc import Callable
from typing import Any

from activestereo.diagnose.answer.ranking import parameter_json
from activestereo.diagnose.channels.depth_engine import Depth
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.search.verdict import EFFECT, NONE, UNDETERMINED


def depth_json(depth: Depth, numbers: Numbers, name_of: Callable[[int], str]) -> dict[str, Any]:
    """Returns the verdict on a depth engine and its fitted effects. nuisance: the effect depends on the matcher alone
    and is no fault. added: the fault that model.json holds. name_of: returns a material's name by its number."""
    faults = depth.faults()[:1]
    verdict, reason = (EFFECT if faults else NONE), None
    if not depth.findings:
        verdict, reason = UNDETERMINED, "the capture has no device depth in its train frames"
    elif not depth.images_agree:
        verdict, reason = UNDETERMINED, "the model's infrared images differ from those that it matched"
    entries = [
        {
            "effect": f.effect.id,
            "family": f.effect.family,
            "finding": f.effect.finding,
            "channel": "depth",
            "score_nats": f.own.nats,
            "confidence": numbers.credible if f.is_named else 0.0,
            "explained_share": f.own.share,
            "parameters": {p.name: parameter_json(p, f.parameters[p.name], name_of) for p in f.effect.parameters},
            "equivalent": [],
            "nuisance": f.effect.engine_fault.is_matcher_choice,
        }
        for f in depth.findings
    ]
    return {"verdict": verdict, "reason": reason, "ranking": entries, "added": [f.effect.id for f in faults]}
