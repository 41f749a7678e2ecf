# SPDX-License-Identifier: Apache-2.0
"""The noise at a gain without repeats: what stays in every frame is none of it."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.lab.gain_noise import law_at_other_gains
from activestereo.lab.noise import NoiseLaw

BLACK_DN, READ_DN, SHOT, OTHER_GAIN = 4.0, 1.5, 0.15, 4.0
LAW = NoiseLaw(READ_DN**2, 0.1, 0.0, BLACK_DN)  # by repeats at gain 1


def law_beside(offset_dn, grain, shot=SHOT):
    """The law of frames at two gains; offset_dn: of pixels that stay; grain: relative, of pixels that stay."""
    rng, shape = np.random.default_rng(3), (120, 160)
    signal = np.broadcast_to(np.linspace(10.0, 120.0, shape[0])[:, None], shape)
    offsets, grains = offset_dn * rng.standard_normal(shape), 1.0 + grain * rng.standard_normal(shape)
    shots, images = [], {}
    for number, gain in enumerate([1.0, 1.0, OTHER_GAIN]):
        # At the higher gain this scene is darker: what is constant is more of its variance.
        light = signal * (0.3 if gain > 1.0 else 1.0)
        variance = READ_DN**2 + (shot if gain > 1.0 else LAW.shot) * gain * light
        measured = light * grains + offsets + BLACK_DN + np.sqrt(variance) * rng.standard_normal(shape)
        frame, view = SimpleNamespace(gain=gain, projector_power=1.0), SimpleNamespace(max_dn=255.0)
        shots.append(SimpleNamespace(frame=frame, view=view, measured=measured, key=(number, "left")))
        images[number, "left"] = light + BLACK_DN
    return law_at_other_gains(LAW, shots, images, {1.0})


@pytest.mark.parametrize(("offset_dn", "grain"), [(0.0, 0.0), (6.0, 0.0), (0.0, 0.08), (4.0, 0.05)])
def test_shot_noise_is_told_from_what_stays(offset_dn, grain):
    assert law_beside(offset_dn, grain).shot == pytest.approx(SHOT, rel=0.25)


def test_offsets_alone_are_no_shot_noise():
    assert law_beside(6.0, 0.0, shot=LAW.shot).shot < 1.4 * LAW.shot
