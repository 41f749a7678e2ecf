# SPDX-License-Identifier: Apache-2.0
"""Describes an error that no effect of the library explains: its stage in the pipeline, and a sparse linear model.

A forward selection (Bayesian information criterion) chooses among few physical terms. They are fitted to tile means of
the residual divided by the light that it would act on. Intervals come from a bootstrap over tiles.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from activestereo.diagnose.evidence import TILE_PX
from activestereo.diagnose.fitter import ImageResidual

_TERMS = 4
_BOOTSTRAPS = 200
_SEED = 5
_STUB = '''"""An effect that the library lacks: edit formula, name and source, then diagnose with --effects
THIS_FILE."""

from activestereo.effects import Parameter, Stage, effect


@effect(
    "my_effect",
    stage=Stage.{stage},
    family="unknown",
    source={source!r},
    parameters=[
        Parameter("amount", "1", neutral=0.0, low=-5.0, high=5.0, typical=1.0, source="1 = the formula as found")
    ],
)
def my_effect({value}, view, amount):
    """{text}"""
    x, y = view.field()
    z = view.depth_m.clip(0.1)
    time_s, warming_k, exposure_s = view.frame.timestamp_s, view.warming_k, view.frame.exposure_s
    formula = {code}
    return {result}
'''


# Of each stage: what the formula is relative to, the image in the stub, and the stub's result.
_STAGES = {
    "PROJECTOR": (
        "the projector's light", "light", "light.scale_projector((1.0 + amount * formula + 0.0 * z).clip(0.0))"
    ),
    "READOUT": ("the signal", "signal", "signal * (1.0 + amount * formula)"),
    "DIGITAL": ("1 DN", "dn", "dn + amount * formula"),
}  # fmt: skip
# Name, code in the stub, and function of (x, y, z, frame's time, kelvins above reference, exposure).
_LIBRARY = (
    ("1", "1.0", lambda c: np.ones_like(c["x"])),
    ("x", "x", lambda c: c["x"]),
    ("y", "y", lambda c: c["y"]),
    ("r^2", "(x**2 + y**2)", lambda c: c["x"] ** 2 + c["y"] ** 2),
    ("x y", "x * y", lambda c: c["x"] * c["y"]),
    ("z", "z", lambda c: c["z"]),
    ("1/z", "(1 / z)", lambda c: 1 / c["z"]),
    ("time", "time_s", lambda c: c["t"]),
    ("warming", "warming_k", lambda c: c["k"]),
    ("exposure", "exposure_s", lambda c: c["e"]),
)


def residual_model(rows: Sequence[ImageResidual], black_dn: float, seed: int = 0) -> dict[str, Any]:
    """Fits a sparse formula to the residuals of the train images; returns diagnose.json's `residual_model`. stage:
    where the error arises. terms: summands with their name, Python code, and factor with a 90 % interval.
    explained_share: of the residual's variance over tiles, the part that the formula explains."""
    stage = _stage(rows)
    tiles = [_tiles(row, stage, black_dn) for row in rows]
    target, weight = (np.concatenate([t[name] for t in tiles]) for name in ("target", "weight"))
    columns = [np.concatenate([function(t) for t in tiles]) for _, _, function in _LIBRARY]
    chosen = _forward(columns, target, weight)
    A = np.stack([columns[i] for i in chosen], axis=1) if chosen else np.zeros((len(target), 0))
    value = _solve(A, target, weight)
    rng = np.random.Generator(np.random.PCG64([_SEED, seed]))
    draws = []
    for _ in range(_BOOTSTRAPS):
        pick = rng.integers(0, len(target), len(target))
        draws.append(_solve(A[pick], target[pick], weight[pick]))
    low, high = np.quantile(np.array(draws).reshape(_BOOTSTRAPS, -1), [0.05, 0.95], axis=0)
    total = (weight * target**2).sum()
    share = float(1.0 - (weight * (target - A @ value) ** 2).sum() / total if total > 0 else 0.0)
    terms = [
        {"term": _LIBRARY[i][0], "code": _LIBRARY[i][1], "value": float(v), "low": float(a), "high": float(b)}
        for i, v, a, b in zip(chosen, value, low, high, strict=True)
    ]
    formula = " ".join(f"{t['value']:+.4g} {t['term']}" for t in terms) or "0"
    text = f"residual / {_STAGES[stage][0]} = {formula} (explains {100 * share:.0f} % of its variation over tiles)"
    return {"stage": stage, "terms": terms, "explained_share": share, "text": text}


def effect_stub(model: Mapping[str, Any], capture: str) -> str:
    """Returns Python text that defines an effect by the formula of residual_model(). capture: the capture's name."""
    code = " + ".join(f"{t['value']:.6g} * {t['code']}" for t in model["terms"]) or "0.0"
    _, value, result = _STAGES[model["stage"]]
    source = f"found by activestereo diagnose in {capture}"
    return _STUB.format(stage=model["stage"], source=source, value=value, text=model["text"], code=code, result=result)


def _stage(rows: Sequence[ImageResidual]) -> str:
    """Returns the stage where the residual arises: PROJECTOR if frames without it are clean, DIGITAL if the residual
    does not grow with light, else READOUT."""
    excess: dict[str, list[float]] = {"off": [], "on": []}
    strength, light = [], []
    for o, image, _, residual in rows:
        excess["off" if o.frame.projector_power == 0 else "on"].append((o.weight * residual**2).mean() - 1.0)
        strength.append(np.abs(residual).mean())
        light.append(image.mean())
    if excess["off"] and np.mean(excess["off"]) < 0.1 * np.mean(excess["on"]):
        return "PROJECTOR"
    grows = len(set(np.round(light, 1))) > 2 and np.corrcoef(light, strength)[0, 1] > 0.3
    return "READOUT" if grows else "DIGITAL"


def _tiles(row: ImageResidual, stage: str, black_dn: float) -> dict[str, np.ndarray]:
    """Returns tile means of the covariates and of the residual divided by the light that it would act on, with their
    weights."""
    o, image, dots, residual = row
    base = {"PROJECTOR": dots, "READOUT": image - black_dn, "DIGITAL": np.ones(image.shape)}[stage]
    index = (o.tile - o.tile.min()).ravel()

    def mean(values: np.ndarray | float) -> np.ndarray:
        return np.bincount(index, np.broadcast_to(values, image.shape).ravel()) / np.bincount(index)

    x, y = o.view.field()
    strength = mean(o.weight * base**2)
    keep = strength > 1e-6
    target = mean(o.weight * base * residual)[keep] / strength[keep]
    covariates = {
        "x": mean(x),
        "y": mean(y),
        "z": mean(np.maximum(o.view.depth_m, 0.1)),
        "t": mean(o.frame.timestamp_s),
        "k": mean(o.view.warming_k),
        "e": mean(o.frame.exposure_s),
    }
    return {name: value[keep] for name, value in covariates.items()} | {
        "target": target,
        "weight": TILE_PX**2 * strength[keep],
    }


def _solve(A: np.ndarray, target: np.ndarray, weight: np.ndarray) -> np.ndarray:
    root = np.sqrt(weight)
    return np.linalg.lstsq(A * root[:, None], target * root, rcond=1e-10)[0]


def _forward(columns: Sequence[np.ndarray], target: np.ndarray, weight: np.ndarray) -> list[int]:
    """Returns the indices of the selected terms, added while the weighted fit's information criterion falls."""
    chosen: list[int] = []
    count = len(target)
    best = count * np.log(max((weight * target**2).sum(), 1e-300))
    while len(chosen) < _TERMS:
        trials = []
        for i in range(len(columns)):
            if i not in chosen:
                A = np.stack([columns[j] for j in [*chosen, i]], axis=1)
                rest = (weight * (target - A @ _solve(A, target, weight)) ** 2).sum()
                trials.append((count * np.log(max(rest, 1e-300)) + np.log(count) * (len(chosen) + 1), i))
        score, i = min(trials)
        if score >= best - np.log(count):
            break
        best, chosen = score, [*chosen, i]
    return chosen
