# SPDX-License-Identifier: Apache-2.0
"""The verdict on the depth engine, from its own ranking: judged after the images, on the model that was found."""

from activestereo.diagnose.findings import Finding, Ranking
from activestereo.diagnose.verdict.acceptance import passes
from activestereo.diagnose.verdict.verdict import EFFECT, NONE, UNDETERMINED


def engine_faults(depth: Ranking) -> list[Finding]:
    """Findings that may be named and that do not depend on the choice of the matcher."""
    return [f for f in depth.findings if passes(depth, f) and not f.effect.engine_fault.is_matcher_choice]


def depth_verdict(depth: Ranking) -> tuple[str, str | None]:
    """(verdict, reason where it is undetermined, else None). Errors of the images are explained first: the engine
    matched those images."""
    if not depth.findings:
        return UNDETERMINED, "the capture has no device depth in its train frames"
    if not depth.at_floor:
        return UNDETERMINED, "the infrared images still lack something, and the depth engine matched those"
    return (EFFECT if engine_faults(depth) else NONE), None
