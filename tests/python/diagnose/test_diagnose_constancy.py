# SPDX-License-Identifier: Apache-2.0
"""Whether a found effect is the same everywhere: its own amplitude alone explains nothing more, another effect's
signature does."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects.core.judging import Channel
from activestereo.diagnose.refine.fitter import ImageResidual
from activestereo.diagnose.findings import BaseChecks, Checks, Explanation, Finding, Ranking, Score
from activestereo.diagnose.thresholds import THRESHOLDS
from activestereo.diagnose.score import constancy
from activestereo.diagnose.score.constancy import varying_reduced_chi2
from activestereo.diagnose.verdict.acceptance import passes

SHAPE = (60, 80)
NOISE_DN = 2.0
U, V = np.linspace(-1, 1, SHAPE[1]), np.linspace(-1, 1, SHAPE[0])[:, None]
EFFECT = SimpleNamespace(id="blur")


def found(monkeypatch, amplitude_of):
    """(noise variances that varying_reduced_chi2 finds, those that are hidden) where the effect's signature is
    amplitude_of(frame, side) too small."""
    rng, rows, plains, hidden = np.random.default_rng(9), [], [], []
    for frame in range(4):
        for side in ("left", "right"):
            weight = np.full(SHAPE, NOISE_DN**-2)
            o = SimpleNamespace(side=side, frame=SimpleNamespace(id=frame), weight=weight, pixels=weight.size)
            plain = 20.0 + 60.0 * rng.random(SHAPE)
            signature = 12.0 * rng.standard_normal(SHAPE)
            missing = amplitude_of(frame, side) * signature
            hidden.append(np.mean(missing**2) / NOISE_DN**2)
            plains.append(plain)
            residual = missing + 0.7 + 0.01 * plain + NOISE_DN * rng.standard_normal(SHAPE)
            rows.append(ImageResidual(o, plain + signature, None, residual))
    monkeypatch.setattr(constancy, "signal", lambda model, o, light, phi: light)
    space = SimpleNamespace(pairs=[(EFFECT, None)], neutral=np.zeros(1), model=lambda theta: None)
    fitter = SimpleNamespace(observations=[o for o, *_ in rows], lights=lambda space, theta: plains)
    solution = SimpleNamespace(space=space, theta=np.ones(1), phi=None)
    return varying_reduced_chi2(fitter, rows, solution, EFFECT), float(np.mean(hidden))


@pytest.mark.parametrize("amplitude", [0.0, 0.3])
def test_one_amplitude_everywhere_leaves_nothing_that_varies(monkeypatch, amplitude):
    excess, _ = found(monkeypatch, lambda frame, side: amplitude)
    assert 0.0 <= excess < 1e-3


@pytest.mark.parametrize(
    "amplitude_of",
    [
        lambda frame, side: 0.3 * U * np.ones(SHAPE),
        lambda frame, side: 0.3 * (V**2 - 1 / 3) * np.ones(SHAPE),
        lambda frame, side: 0.3 * (-1) ** frame,
        lambda frame, side: 0.3 if side == "left" else -0.3,
    ],
)
def test_what_varies_over_the_picture_frames_or_cameras_is_found(monkeypatch, amplitude_of):
    excess, hidden = found(monkeypatch, amplitude_of)
    assert excess == pytest.approx(hidden, rel=0.03, abs=1e-3)


@pytest.mark.parametrize(
    ("varying", "is_named"),
    [(0.0, True), (0.02, True), (0.12, False)],
)
def test_what_varies_much_is_not_named(varying, is_named):
    gain = 0.2
    base = SimpleNamespace(chi2=125.0, white_reduced_chi2=0.0)
    explanation = Explanation(EFFECT, Channel.EXPECTED_IMAGE, {}, 125.0 - 100.0 * gain, np.zeros(1))
    checks = Checks(varying_reduced_chi2=varying, structure_reduced_chi2=0.0)
    finding = Finding(explanation, Score(500.0, 0.95, gain, 1.0), checks)
    ranking = Ranking(base, BaseChecks(structure_reduced_chi2=0.0), (finding,), (), 100, 1.0, 100.0, THRESHOLDS)
    assert passes(ranking, finding) is is_named
