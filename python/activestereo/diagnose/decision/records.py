# SPDX-License-Identifier: Apache-2.0
"""Plain numbers that a decision needs of each model that was fitted: answers keep them, so that it is made again
without a renderer."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Freedom:
    """The free parameters of a model's effects, as Laplace's integral asks for them.

    away: distances from neutral in typical values. log_density: of the prior there, per typical value. information: of
    the images on them in those units, [n][n], nuisances fitted beside, neighbours counted as far as they vary apart.
    """

    away: tuple[float, ...]
    log_density: tuple[float, ...]
    information: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ModelRecord:
    """One model: the given one with effects added. Mean squares are in noise variances; None: not computed.

    channel: of the last effect; empty where a step starts. left: mean square of each view. left_out: the same,
    predicted by what the other views tell. structure: of each view (score/structure.py). varying: what varying
    amplitudes explain (score/constancy.py). strain: sum of squares of nuisances, in the deviations stated of them.
    rounding: what coarse steps leave in repeats alike. own_nats, own_share: of channels with evidence of their own.
    choice_nats: of choices that were open. closed_low: the lower end of the share of the squared error that it removes.
    """

    effects: tuple[str, ...]
    channel: str
    left: tuple[float, ...]
    left_out: tuple[float, ...] | None = None
    structure: tuple[float, ...] | None = None
    varying: float = 0.0
    strain: float | None = None
    freedom: Freedom | None = None
    rounding: float = 0.0
    own_nats: float | None = None
    own_share: float = 0.0
    choice_nats: float = 0.0
    closed_low: float | None = None


@dataclass(frozen=True)
class Findings:
    """All models that a diagnosis fitted. Of the given one: white, what stays between repeats and is white; unsteady,
    by how much one frame of a view differs more than another (score/steadiness.py); plain, the excess of the squared
    error in DN. tried: how many effects. has_floor: whether noise was measured. independent: pixels of a view that vary
    apart from each other. together: fields of draws that the last model's frames show at once."""

    white: float
    unsteady: float
    plain: float
    tried: int
    has_floor: bool
    independent: float
    models: tuple[ModelRecord, ...]
    together: tuple[str, ...] = ()

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
        known: dict[str, Any] = {**stored, "models": tuple(map(_record, stored["models"]))}
        return cls(**known)


def _record(stored: Mapping[str, Any]) -> ModelRecord:
    freedom = stored["freedom"] and Freedom(**stored["freedom"])
    known: dict[str, Any] = {**stored, "effects": tuple(stored["effects"]), "freedom": freedom}
    return ModelRecord(**known)
