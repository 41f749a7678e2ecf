# SPDX-License-Identifier: Apache-2.0
"""Estimates noise and weights again under the model found: a missing effect passes for noise and for misplaced edges.

A dark signal that grows with temperature is not light, but photon transfer takes it for light. If it grows from one
repeat to the next, it adds to their variance. The model found so far removes both.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.noise import by_repeats, frame_noise_variances, noise_at_other_gains
from activestereo.diagnose.evidence.model_discrepancy import edge_discrepancy
from activestereo.diagnose.evidence.observation import Evidence, weight_of
from activestereo.diagnose.refine import ImageResidual
from activestereo.effects import Model


def weighed_again(evidence: Evidence, model: Model, black_dn: float, rows: Sequence[ImageResidual]) -> Evidence:
    """Estimates noise and pixel weights of the train images again under a model, and returns the Evidence with them.
    rows: the train images' residuals under the model."""
    train, expected = evidence.train, {row.observation.key: row.expected for row in rows}
    dark = {o.key: model.digital(np.zeros(o.view.shape), o.view, black_dn) - black_dn for o in train}
    noise_model, variances = evidence.noise_model, evidence.noise_variances
    lit_train = [replace(o, measured=o.measured - dark[o.key]) for o in train]
    lit = {key: image - dark[key] for key, image in expected.items()}
    if evidence.has_floor:
        groups = by_repeats((o.frame, o.side, o.key) for o in train)
        means = ((keys, np.mean([expected[k] for k in keys], axis=0)) for keys in groups)
        no_noise = dark | {key: expected[key] - mean for keys, mean in means for key in keys}
        own, found = frame_noise_variances(evidence.capture, evidence.nuisances.black_dn, no_noise)
        if found is not None:
            own_variances = {key: max(variance, ROUNDING_VARIANCE) for key, (variance, _) in own.items()}
            noise_model, others = noise_at_other_gains(found, lit_train, lit)
            variances = own_variances | others
    edges_m = edge_discrepancy(lit_train, lit, noise_model)
    weighed = tuple(replace(o, weight=weight_of(noise_model, edges_m, o, lit[o.key])) for o in train)
    return replace(
        evidence, train=weighed, noise_model=noise_model, noise_variances=evidence.noise_variances | variances,
    )  # fmt: skip
