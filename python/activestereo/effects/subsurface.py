"""Light that wanders below the surface."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.resample import blur
from activestereo.effects.core.surfaces import SURFACES, on_surfaces


@effect(
    "subsurface",
    stage=Stage.SURFACE,
    family="surface",
    source="Jensen et al. 2001, A practical model for subsurface light transport: millimetres in skin, wax, marble, foam",
    parameters=[
        Parameter("fraction", "1", neutral=0.0, low=0.0, high=1.0, typical=0.4, source="share of the light that enters"),
        Parameter("length_m", "m", neutral=0.003, low=0.0002, high=0.02, typical=0.002, source="rms distance along one axis; without effect at fraction 0"),
        SURFACES,
    ],
)
def subsurface(light, view, fraction, length_m, surfaces):
    """Dots grow wide tails of one width in metres on the surface, so that near dots look wider; ambient edges stay sharp."""
    if fraction == 0.0:
        return light
    hit = view.depth_m > 0
    sigma_px = np.where(hit, view.K[0, 0] * length_m / np.where(hit, view.depth_m, 1.0), 0.0)
    spread, share = blur(np.stack([light.direct, light.flat]), sigma_px)
    # What spreads is the dots' irradiance: reflectance and shadows stay where they are.
    dots = np.where(share > 0, spread / np.where(share > 0, share, 1.0), 0.0)
    return on_surfaces(light, replace(light, direct=(1.0 - fraction) * light.direct + fraction * light.flat * dots), view, surfaces)
