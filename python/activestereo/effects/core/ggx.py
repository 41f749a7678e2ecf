# SPDX-License-Identifier: Apache-2.0
"""The dielectric highlight of glTF 2.0's material model: GGX, Fresnel's exact reflectance, specularFactor 1.

Arrays of cosines and directions may have any leading shape; roughness is a number (alpha = roughness squared); ior is
1.5 where it is not given, as in glTF.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.integrate import trapezoid

IOR = 1.5
_COSINES = 33
_RINGS, _SPOKES = 96, 64


def ior_of(reflectance: float) -> float:
    """The index of refraction that reflects this share at normal incidence."""
    root = np.sqrt(reflectance)
    return float((1.0 + root) / (1.0 - root))


class Cosines(NamedTuple):
    """Between normal (n), light (l), camera (v) and the half vector of these two (h); [...] each, or a number."""

    n_h: np.ndarray
    n_l: np.ndarray
    n_v: np.ndarray | float
    h_v: np.ndarray


def cosines_of(normal: np.ndarray, to_light: np.ndarray, to_camera: np.ndarray) -> Cosines:
    """The cosines of directions [...][3], unit."""
    half = to_light + to_camera
    half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-12)
    dot = lambda a, b: np.clip((a * b).sum(-1), 0.0, 1.0)  # noqa: E731
    return Cosines(dot(normal, half), dot(normal, to_light), dot(normal, to_camera), dot(half, to_camera))


def highlight(cosines: Cosines, roughness: float, ior: float = IOR) -> np.ndarray:
    """Radiance reflected per irradiance, [...]. Walter et al. 2007, height-correlated Smith shadowing."""
    n_h, n_l, n_v, h_v = cosines
    square = roughness**4
    density = square / (np.pi * (n_h * n_h * (square - 1.0) + 1.0) ** 2)
    masked = n_l * np.sqrt(n_v * n_v * (1.0 - square) + square) + n_v * np.sqrt(n_l * n_l * (1.0 - square) + square)
    return np.where((n_l > 0) & (n_v > 0), fresnel(h_v, ior) * density * 0.5 / np.maximum(masked, 1e-6), 0.0)


def fresnel(cosine: float | np.ndarray, ior: float = IOR) -> np.ndarray:
    """Reflectance of unpolarised light (Hecht, Optics, 4.6)."""
    inside = np.sqrt(1.0 - (1.0 - cosine * cosine) / ior**2)
    across = (cosine - ior * inside) / (cosine + ior * inside)
    along = (ior * cosine - inside) / (ior * cosine + inside)
    return 0.5 * (across**2 + along**2)


def reflected_share(cosine: np.ndarray, roughness: float, ior: float = IOR) -> np.ndarray:
    """Share of light from a direction, at a cosine to the normal, that the lobe reflects."""
    return np.interp(cosine, *_shares(float(roughness), float(ior)))


def base_share(
    cosine_in: np.ndarray, cosine_out: np.ndarray, roughness: float, factor: float, ior: float = IOR
) -> np.ndarray:
    """How bright the diffuse base is below `factor` of the lobe, relative to the bare one: what the lobe lets in and
    out, as the renderer has it (Kelemen and Szirmay-Kalos 2001)."""
    cosines, shares = _shares(float(roughness), float(ior))
    mean = trapezoid(shares * 2 * cosines, cosines)
    let_in, let_out = (1.0 - factor * reflected_share(cosine, roughness, ior) for cosine in (cosine_in, cosine_out))
    return let_in * let_out / (1.0 - factor * mean)


@lru_cache(maxsize=64)
def _shares(roughness: float, ior: float) -> tuple[np.ndarray, np.ndarray]:
    """(cosines, reflected shares): the lobe's integral over outgoing directions, by rings of equal projected solid
    angle about the half vector's density, so that narrow lobes are resolved."""
    cosines = np.linspace(0.0, 1.0, _COSINES)
    cosines[0] = 1e-3
    square = roughness**4
    quantile, angle = (np.arange(_RINGS) + 0.5) / _RINGS, (np.arange(_SPOKES) + 0.5) / _SPOKES * 2 * np.pi
    n_h = np.sqrt((1.0 - quantile) / (1.0 + (square - 1.0) * quantile))[:, None]
    side = np.sqrt(1.0 - n_h * n_h)
    across, density = side * np.cos(angle), square / (np.pi * (n_h * n_h * (square - 1.0) + 1.0) ** 2) * n_h
    shares = []
    for cosine in cosines:
        v_h = across * np.sqrt(1.0 - cosine * cosine) + n_h * cosine
        n_l = 2 * v_h * n_h - cosine
        way = Cosines(n_h, np.clip(n_l, 0.0, 1.0), cosine, np.clip(v_h, 0.0, 1.0))
        # Density of the half vectors is D n_h, of the reflected ones that over 4 v_h.
        ratio = n_l * 4.0 * np.maximum(v_h, 1e-9) / np.maximum(density, 1e-300)
        shares.append(np.where((v_h > 0) & (n_l > 0), highlight(way, roughness, ior) * ratio, 0.0).mean())
    return cosines, np.array(shares)
