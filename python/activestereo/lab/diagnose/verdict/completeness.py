# SPDX-License-Identifier: Apache-2.0
"""Whether what an explanation leaves asks for another effect."""

from activestereo.lab.diagnose.findings import Ranking, Remainder


def follows_other_law(ranking: Ranking, remainder: Remainder, first: Ranking) -> bool:
    """Whether the trace of an added effect is there, but not as large everywhere as its law says.

    first: the ranking without effects.
    """
    gates = ranking.gates
    limit = max(gates.other_law_share * (first.base.chi2 - remainder.chi2) / ranking.pixels, gates.other_law_floors)
    return any(varying > limit for varying in remainder.variation.values())


def is_unexplained(ranking: Ranking, remainder: Remainder, first: Ranking | None = None) -> bool:
    """Whether what an explanation leaves (the base, where nothing is named) asks for another effect.

    first: the ranking without effects, where something is named. Noise of single pixels asks for none: its level is a
    nuisance, and what is random and stays has candidates of its own. Those explain no structure: it is the base's
    that counts beside them. Where nothing is named, more than surveys leave asks, too; what is named has to follow
    its own law.
    """
    gates = ranking.gates
    excess = remainder.chi2 / ranking.pixels - 1.0 - (1.0 + gates.rounding_known_to) * remainder.repeats_floors
    if first is None and excess - ranking.base.white_floors > gates.largest_of_surveys_floors:
        return True
    if first is not None and excess > 0.0 and follows_other_law(ranking, remainder, first):
        return True
    structure = remainder.structure_floors or 0.0
    if excess <= gates.unexplained_floors:
        return False
    if structure <= (gates.unexplained_floors if first is None else gates.structure_of_named_floors):
        return False
    return first is None or structure > gates.unexplained_share * (first.base_checks.structure_floors or 0.0)
