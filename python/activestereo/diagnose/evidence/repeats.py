# SPDX-License-Identifier: Apache-2.0
"""Noise and weights estimated again after an effect was found that adds a dark signal or makes repeats differ.

A dark signal that grows with temperature is not light, but the photon-transfer fit takes it for light; where it grows
from one repeat to the next, it adds to the variance of the repeats although it is not noise. The estimated noise floor
is then too high and hides other effects. The model found so far removes both.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.noise import by_repeats, frame_noise_variances
from activestereo.diagnose.evidence.gather import noise_at_other_gains
from activestereo.diagnose.evidence.model_discrepancy import edge_discrepancy
from activestereo.diagnose.evidence.observation import Evidence, Observation, weight_of
from activestereo.effects import Model

Images = Mapping[tuple[int, str], np.ndarray]


def without_drift(
    evidence: Evidence, model: Model, black_dn: float, expected: Images, least_fall: float
) -> Evidence:
    """The Evidence with noise and weights estimated from images less the model's dark signal and drift; the evidence
    itself where the noise floor falls by less than a share least_fall.

    black_dn, expected: black level, and DN [height][width] of every train and test image, under the model found so far.
    """
    if not evidence.has_floor:
        return evidence
    measured_images = (*evidence.train, *evidence.test)
    dark = {o.key: model.digital(np.zeros(o.view.shape), o.view, black_dn) - black_dn for o in measured_images}
    no_noise = dark | _drift(measured_images, expected)
    noise_variances, noise_model = frame_noise_variances(evidence.capture, evidence.nuisances.black_dn, no_noise)
    if noise_model is None:
        return evidence
    found = {key: max(variance, ROUNDING_VARIANCE) for key, (variance, _) in noise_variances.items()}
    lit_images = {o.key: replace(o, measured=o.measured - dark[o.key]) for o in measured_images}
    lit_train = [lit_images[o.key] for o in evidence.train]
    lit = {key: image - dark[key] for key, image in expected.items()}
    lit_noise_model, found = noise_at_other_gains(noise_model, found, list(lit_images.values()), lit_train, lit)
    shown = [o.key for o in evidence.train]
    if sum(found[k] for k in shown) > (1.0 - least_fall) * sum(evidence.noise_variances[k] for k in shown):
        return evidence
    edges_m = edge_discrepancy(lit_train, lit, lit_noise_model)

    def weighed(observations: Sequence[Observation]) -> tuple[Observation, ...]:
        return tuple(replace(o, weight=weight_of(lit_noise_model, edges_m, o, lit[o.key])) for o in observations)

    return replace(
        evidence,
        train=weighed(evidence.train),
        test=weighed(evidence.test),
        noise_model=lit_noise_model,
        noise_variances=found,
        edge_discrepancy_m=edges_m,
    )


def _drift(measured_images: Sequence[Observation], expected: Images) -> Images:
    """The difference of every repeat's expected image from the mean of its group's, DN."""
    groups = by_repeats((o.frame, o.side, o.key) for o in measured_images)
    means = ((keys, np.mean([expected[k] for k in keys], axis=0)) for keys in groups)
    return {key: expected[key] - mean for keys, mean in means for key in keys}
