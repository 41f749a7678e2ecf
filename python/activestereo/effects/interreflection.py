# SPDX-License-Identifier: Apache-2.0
"""Simulates bounced light of another strength than rendered."""

from dataclasses import replace

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@effect(
    "interreflection",
    stage=Stage.SURFACE,
    family="surface",
    finding="Surfaces light each other by another amount than the scene file says",
    source="radiosity: bounced light goes with the product of two albedos (Goral et al. 1984)",
    parameters=[
        Parameter(
            "gain", "1", neutral=0.0, low=-1.0, high=3.0, typical=0.3, source="-1 = a model of single reflections"
        )
    ],
    image_only="kuafu computes bounced light from the albedos alone",
)
def interreflection(light: Light, view: View, gain: float) -> Light:
    """Light reflected by other surfaces, which is smooth and strongest in corners, is 1 + gain times the rendered
    amount. Ambient light is included where its indirect share is known."""
    changed = replace(light, indirect=light.indirect * (1.0 + gain))
    if view.ambient_bounced is None:
        return changed
    return replace(changed, ambient=light.ambient * (1.0 + gain * view.ambient_bounced))
