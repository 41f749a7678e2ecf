# SPDX-License-Identifier: Apache-2.0
"""A ranking as diagnose.json holds it."""

from collections.abc import Callable, Iterable, Sequence

from activestereo.diagnose.findings import Finding, NotRanked, Ranking
from activestereo.diagnose.score.intervals import Interval
from activestereo.diagnose.verdict.confidence import confidences, equivalents
from activestereo.diagnose.verdict.depth import depth_verdict
from activestereo.diagnose.verdict.reasons import reason_of
from activestereo.effects import Effect, Model, Parameter
from activestereo.effects.core.judging import Channel
from activestereo.effects.core.surfaces import material_numbers

_CHANNEL = {
    Channel.EXPECTED_IMAGE: "infrared",
    Channel.STATIC_FIELD: "infrared",
    Channel.NOISE_MODEL: "noise",
    Channel.DEPTH_ENGINE: "depth",
}

Json = dict[str, object]


def ranking_json(ranking: Ranking, name_of: Callable[[int], str]) -> list[Json]:
    """Every finding, best first. name_of: a material's name."""
    confidence = confidences(ranking)
    return [_finding_json(ranking, f, confidence[f.id], name_of) for f in ranking.findings]


def depth_json(depth: Ranking, faults: Sequence[Finding], name_of: Callable[[int], str]) -> Json:
    """The verdict on the depth engine.

    faults: findings that are added to the model. nuisance: a difference that depends on the matcher alone.
    """
    verdict, reason = depth_verdict(depth)
    entries = ranking_json(depth, name_of)
    for entry, f in zip(entries, depth.findings, strict=True):
        entry["nuisance"] = f.effect.engine_fault.is_matcher_choice
    return {"verdict": verdict, "reason": reason, "ranking": entries, "added": [f.id for f in faults]}


def own_json(own: Iterable[Effect], rankings: Sequence[Ranking], given: Model) -> dict[str, str]:
    """{id: why it stands where it does} of a user's own effects, ranked or not. given: the model to start from."""
    said = {e.id: "it is part of the model that the diagnosis started from" for e, _ in given.effects}
    said |= {n.effect.id: n.reason for ranking in rankings for n in ranking.not_ranked}
    said |= {f.id: reason_of(ranking, f) for ranking in rankings for f in ranking.findings}
    return {e.id: said.get(e.id, "it was not tried on this capture") for e in own}


def not_ranked_json(skipped: Iterable[NotRanked]) -> list[Json]:
    """The effects that could not be ranked, with the reason."""
    return [{"effect": s.effect.id, "family": s.effect.family, "reason": s.reason} for s in skipped]


def _finding_json(ranking: Ranking, f: Finding, confidence: float, name_of: Callable[[int], str]) -> Json:
    return {
        "effect": f.id,
        "family": f.effect.family,
        "finding": f.effect.finding,
        "channel": _CHANNEL[f.channel],
        "score_nats": f.score.nats,
        "confidence": confidence,
        "explained_share": f.score.explained_share,
        "gain_reduced_chi2": f.score.gain_reduced_chi2,
        "closed_share": f.checks.plain_share,
        "closed_share_low": f.checks.plain_share_low,
        "frame_consistency": f.score.consistency,
        "parameters": parameters_json(f, name_of),
        "equivalent": equivalents(ranking, f),
    }


def parameters_json(f: Finding, name_of: Callable[[int], str]) -> Json:
    """{name: a parameter as found}."""
    return {p.name: parameter_json(p, f.explanation.parameters[p.name], name_of) for p in f.effect.parameters}


def parameter_json(parameter: Parameter, found: Interval, name_of: Callable[[int], str]) -> Json:
    """A parameter's finding; for a choice of surfaces with their materials' names, none for all surfaces."""
    names = {"materials": [name_of(k) for k in material_numbers(found.value)]} if parameter.choice else {}
    return found.as_json() | names
