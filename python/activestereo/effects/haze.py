"""A participating medium between rig and scene."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect


@effect(
    "haze",
    stage=Stage.MEDIUM,
    family="medium",
    source="Koschmieder 1924; single scattering of uniform ambient light",
    parameters=[Parameter("extinction_per_m", "1/m", neutral=0.0, low=0.0, high=3.0, typical=0.1)],
)
def haze(light, view, extinction_per_m):
    """Light fades by exp(-extinction x way); the uniform ambient light is scattered in where it is scattered out."""
    to_camera = np.linalg.norm(view.points(), axis=-1)
    to_projector = np.linalg.norm(view.projector_points(), axis=-1)
    seen = np.where(view.depth_m > 0, np.exp(-extinction_per_m * to_camera), 0.0)
    dots = np.where(view.depth_m > 0, np.exp(-extinction_per_m * (to_camera + to_projector)), 1.0)
    hit = view.depth_m > 0
    ambient = np.where(hit, light.ambient * seen + (1.0 - seen), light.ambient)
    return replace(light.scale_projector(dots), ambient=ambient)
