# SPDX-License-Identifier: Apache-2.0
"""What a decision needs to know of each model that was fitted, as plain numbers: answers keep them, so that a decision
is made again without a renderer."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Freedom:
    """The free parameters of a model's effects: what a marginal likelihood asks of them.

    away: distances from neutral in typical values. log_density: of the prior there, per typical value. information: of
    all pixels on them in those units, nuisances fitted beside, [n][n]; no discrepancy of any model is in it.
    """

    away: tuple[float, ...]
    log_density: tuple[float, ...]
    information: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ModelRecord:
    """One model: the given one with effects added.

    channel: of the last effect; empty where a step starts. chi2: cross-validated. view_chi2, view_left_out: of each view as fitted, and predicted with what the other views
    tell of all that views share. structure: of each image, in noise variances (score/structure.py). varying: what
    varying amplitudes explain, in noise variances. strain: sum of squares of nuisances in the deviations that are
    stated of them. rounding: what coarse steps leave in repeats alike, in noise variances. own_nats, own_share: of
    channels with evidence of their own. closed_low: the lower end of the share of the squared error that it removes.
    at_range_end: a shape was driven to an end of its range. None: not known.
    """

    effects: tuple[str, ...]
    channel: str
    chi2: float
    view_chi2: tuple[float, ...] = ()
    view_left_out: tuple[float, ...] | None = None
    structure: tuple[float, ...] | None = None
    varying: float = 0.0
    strain: float | None = None
    rounding: float = 0.0
    own_nats: float | None = None
    own_share: float = 0.0
    closed_low: float | None = None
    at_range_end: bool = False
    freedom: Freedom | None = None
    choice_nats: float = 0.0


@dataclass(frozen=True)
class Findings:
    """All models that a diagnosis fitted, on the same pixels.

    pixels: how many, of each view. white: what stays between repeats and is white, in noise variances. unsteady,
    uneven: of the given model (score/steadiness.py). tried: how many effects. has_floor: whether noise was measured.
    """

    pixels: tuple[int, ...]
    white: float
    unsteady: float
    uneven: float
    tried: int
    has_floor: bool
    models: tuple[ModelRecord, ...]

    def steps(self) -> list[list[ModelRecord]]:
        """The models of each step: what it starts from, then what was added to that."""
        out: list[list[ModelRecord]] = []
        for model in self.models:
            if not model.channel:
                out.append([])
            out[-1].append(model)
        return out

    def as_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def of_json(cls, stored: Mapping[str, Any]) -> "Findings":
        return cls(**{**stored, "models": tuple(_record(model) for model in stored["models"])})


def _record(stored: Mapping[str, Any]) -> ModelRecord:
    freedom = stored["freedom"] and Freedom(**stored["freedom"])
    known: dict[str, Any] = {**stored, "effects": tuple(stored["effects"]), "freedom": freedom}
    return ModelRecord(**known)
