# SPDX-License-Identifier: Apache-2.0
"""Computes how surfaces reflect: their angles to camera and projector, the reflectance that rendered layers show,
gloss, scattering below a surface, transparency. The highlight is glTF 2.0's dielectric: GGX, exact Fresnel reflectance,
specularFactor 1.

Arrays of cosines and directions may have any leading shape; roughness is a number (alpha = roughness squared); ior is
1.5 where it is not given, as in glTF."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.integrate import trapezoid

import kuafu
from activestereo.common.computed_once import computed_once
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import BlurAlong
from activestereo.effects.core.view import View

IOR = 1.5
_COSINES = 33
_RINGS, _SPOKES = 96, 64


class Cosines(NamedTuple):
    """Cosines between the normal (n), light (l), camera (v) and the half vector of light and camera (h); arrays or
    numbers."""

    n_h: np.ndarray
    n_l: np.ndarray
    n_v: np.ndarray | float
    h_v: np.ndarray


def cosines_of(normal: np.ndarray, to_light: np.ndarray, to_camera: np.ndarray) -> Cosines:
    """Returns the Cosines of unit directions [...][3], limited to 0..1."""
    half = _unit(to_light + to_camera)
    dot = lambda a, b: np.clip(dot_products(a, b), 0.0, 1.0)  # noqa: E731
    return Cosines(dot(normal, half), dot(normal, to_light), dot(normal, to_camera), dot(half, to_camera))


def highlight(cosines: Cosines, roughness: float, ior: float = IOR) -> np.ndarray:
    """Returns the highlight's radiance per irradiance, [...]: GGX with height-correlated Smith shadowing (Walter et al.
    2007)."""
    n_h, n_l, n_v, h_v = cosines
    square = roughness**4
    density = square / (np.pi * (n_h * n_h * (square - 1.0) + 1.0) ** 2)
    masked = n_l * np.sqrt(n_v * n_v * (1.0 - square) + square) + n_v * np.sqrt(n_l * n_l * (1.0 - square) + square)
    return np.where((n_l > 0) & (n_v > 0), fresnel(h_v, ior) * density * 0.5 / np.maximum(masked, 1e-6), 0.0)


def fresnel(cosine: float | np.ndarray, ior: float = IOR) -> np.ndarray:
    """Returns the reflectance of unpolarised light at a cosine to the normal (Hecht, Optics, 4.6)."""
    inside = np.sqrt(1.0 - (1.0 - cosine * cosine) / ior**2)
    across = (cosine - ior * inside) / (cosine + ior * inside)
    along = (ior * cosine - inside) / (ior * cosine + inside)
    return 0.5 * (across**2 + along**2)


def reflected_share(cosine: np.ndarray, roughness: float, ior: float = IOR) -> np.ndarray:
    """Returns the share of the light that the highlight reflects in all directions. cosine: of the incoming light to
    the normal."""
    return np.interp(cosine, *_shares(float(roughness), float(ior)))


def base_share(
    cosine_in: np.ndarray, cosine_out: np.ndarray, roughness: float, factor: float, ior: float = IOR
) -> np.ndarray:
    """Returns the brightness of the diffuse base below a highlight of strength `factor`, over that of the bare base.
    The highlight's layer lets less light in and out, as in the renderer (Kelemen and Szirmay-Kalos 2001)."""
    cosines, shares = _shares(float(roughness), float(ior))
    mean = trapezoid(shares * 2 * cosines, cosines)
    let_in, let_out = (1.0 - factor * reflected_share(cosine, roughness, ior) for cosine in (cosine_in, cosine_out))
    return let_in * let_out / (1.0 - factor * mean)


@lru_cache(maxsize=64)
def _shares(roughness: float, ior: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns (cosines of incoming light to the normal, the shares of it that the highlight reflects), [n] each. The
    integral's samples are distributed as the half vector's density, so that narrow highlights are resolved."""
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
        # Half vectors have the density D n_h; reflected directions have it divided by 4 v_h.
        ratio = n_l * 4.0 * np.maximum(v_h, 1e-9) / np.maximum(density, 1e-300)
        shares.append(np.where((v_h > 0) & (n_l > 0), highlight(way, roughness, ior) * ratio, 0.0).mean())
    return cosines, np.array(shares)


# Light at a smaller cosine, grazing the surface, does not show its reflectance.
_LEAST_COSINE = 0.05


class Facing:
    """Geometry of each pixel's surface towards camera and projector. Directions are unit vectors [height][width][3] in
    camera coordinates. Cosines to the normal are 0 where nothing is hit or the surface faces away."""

    @classmethod
    def of(cls, view: View) -> Facing:
        """Returns the Facing of a view, computed once per view."""
        return view.once("facing", lambda: cls(view))

    def __init__(self, view: View) -> None:
        self.hit = view.depth_m > 0
        self.points = view.points()
        self.to_camera = _unit(-self.points)
        self.normal = np.where(dot_products(view.normal, self.to_camera)[..., None] < 0, -view.normal, view.normal)
        self.camera_cosine = self.cosine(self.to_camera)
        source = np.linalg.inv(view.camera_to_projector)[:3, 3]
        self.to_projector, self.projector_cosine, self.irradiance = self.from_source(source)

    @computed_once
    def lobe(self) -> Cosines:
        """Returns the Cosines of the highlight that the projector's light makes on each pixel's surface, towards the
        camera."""
        return cosines_of(self.normal, self.to_projector, self.to_camera)

    def from_source(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns, for a point source at `position` (camera coordinates), each pixel's direction to it, cosine to the
        normal, and irradiance per radiant intensity, 1/m^2. Shadows are left out."""
        way = position - self.points
        square = np.maximum(dot_products(way, way), 1e-12)
        direction = way / np.sqrt(square)[..., None]
        cosine = self.cosine(direction)
        return direction, cosine, cosine / square

    def cosine(self, direction: np.ndarray) -> np.ndarray:
        """Returns the cosine of unit directions to each pixel's normal."""
        return np.where(self.hit, np.maximum(dot_products(self.normal, direction), 0.0), 0.0)


def reflectance_of(light: Light, view: View) -> np.ndarray:
    """Returns the surfaces' diffuse radiance per irradiance, albedo / pi, [height][width], computed from the light.
    Where the projector does not reach, it is the ambient light times the scene's median ratio of both. The view stores
    it for the latest light."""

    def shown() -> np.ndarray:
        facing = Facing.of(view)
        lit = facing.hit & (light.flat > 0) & (facing.projector_cosine > _LEAST_COSINE)
        own = light.flat / np.where(lit, facing.irradiance, 1.0)
        share = np.median((own / np.maximum(light.ambient, 1e-12))[lit]) if lit.any() else 0.0
        return np.where(facing.hit, np.where(lit, own, light.ambient * share), 0.0)

    return view.latest("reflectance", light, shown)


def dot_products(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Returns the dot products of vectors [...][3], in half the time of a product and a sum."""
    return np.einsum("...i,...i", a, b)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.sqrt(dot_products(vectors, vectors)), 1e-12)[..., None]


# (weight, width in rms lengths) of Gaussians whose sum is a profile: the light within any radius agrees to 0.006.
# This profile is two exponentials over the distance, as in _mean_free_path_m's source. Light that leaves after few
# scatterings makes a bright core where it enters.
_WITH_CORE = ((0.081, 0.032), (0.254, 0.193), (0.396, 0.643), (0.269, 1.751))
# This profile is exp(-distance / width), whose rms distance is sqrt(3) widths. A medium that scatters forward turns
# light around only deep inside (Jensen et al. 2001: the diffuse part has no core either).
_WITHOUT_CORE = ((0.118, 0.308), (0.525, 0.735), (0.357, 1.389))

# A pixel with less than this share of the brightest pixel's light lies in shadow.
_LEAST_LIT = 1e-3
# The number of blurred images that are kept: a scan returns to a length and profile with another fraction.
_PROFILES_KEPT = 4


def paths_per_length(albedo: float) -> float:
    """Returns the ratio of a medium's mean free path to the rms distance, along one axis, between where its light
    enters and leaves. Christensen and Burley 2015 (Approximate reflectance profiles for efficient subsurface
    scattering): the profile of two exponentials of width d = path / s has an rms distance of sqrt(7) d."""
    return (1.9 - albedo + 3.5 * (albedo - 0.8) ** 2) / float(np.sqrt(7.0))


def reflected(light: Light, view: View, material: kuafu.Material, unrendered: dict[str, float]) -> Light:
    """Returns the light as if all surfaces had this material's gloss, scattering and transparency. Each keeps its own
    diffuse colour. unrendered: see EngineInputs."""
    if material.specular:
        light = _glossy(light, view, material)
    if material.subsurface:
        light = _scattered_below(light, view, material, unrendered["core"])
    if material.ir_transmission:
        through = np.where(view.depth_m > 0, material.ir_transmission, 0.0)
        seen = light.images * (1.0 - through)
        seen[2] += through * unrendered["behind"]
        light = Light.of_images(seen, light.supersampled)
    return light


def _glossy(light: Light, view: View, material: kuafu.Material) -> Light:
    """Returns the light with a highlight of the projector's dots and a sheen of the surroundings."""
    facing, share = Facing.of(view), material.specular
    assert material.ir_roughness is not None and material.ir_ior is not None  # the effect has set them
    layer = material.ir_roughness, material.ir_ior
    lit = light.flat > 0
    cosines = np.maximum(facing.camera_cosine, 1e-3), np.maximum(facing.projector_cosine, 1e-3)
    flat = light.flat * base_share(*cosines, layer[0], share, layer[1]) + np.where(
        lit, share * highlight(facing.lobe(), *layer) * facing.irradiance, 0.0
    )
    dots = light.direct / np.where(lit, light.flat, 1.0)
    sheen = share * np.where(facing.hit, reflected_share(cosines[0], *layer), 0.0)
    white = np.pi * reflectance_of(light, view)
    # The share of the surroundings that a surface sees: its ambient light over that of an open surface of its albedo.
    open_share = np.clip(light.ambient / np.where(white > 0, white, np.inf), 0.0, 1.0)
    ambient = light.ambient * (1.0 - sheen) + sheen * open_share
    return replace(light, direct=np.where(lit, dots * flat, light.direct), flat=flat, ambient=ambient)


def _scattered_below(light: Light, view: View, material: kuafu.Material, core: float) -> Light:
    """Returns the light after a share of the dots' light spread below the surface (subsurface scattering). The
    surfaces' reflectance and shadows stay. core: weight 0..1 of the spread profile that has a bright core; the other
    has none."""
    fraction = material.subsurface
    assert material.ir_subsurface_radius_m is not None and material.ir_subsurface_color is not None
    length_m = material.ir_subsurface_radius_m / paths_per_length(material.ir_subsurface_color)
    profiles = ((core, _WITH_CORE), (1.0 - core, _WITHOUT_CORE))
    wandered = (part * _wandered(light, view, length_m, profile) for part, profile in profiles if part > 0.0)
    spread, share = sum(wandered, np.zeros((2, *view.shape)))
    dots = np.where(share > 0, spread / np.where(share > 0, share, 1.0), 0.0)
    return replace(light, direct=(1.0 - fraction) * light.direct + fraction * light.flat * dots)


def _wandered(light: Light, view: View, length_m: float, profile: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Returns two images [2][height][width], blurred as light spreads below the surface: the pattern's value in lit
    pixels, and the mask of lit pixels. Their ratio is the spread pattern. length_m: rms length of the spread. profile:
    pairs (weight, width in length_m) of Gaussians."""

    def spread() -> np.ndarray:
        across, down = view.once("blurs below", lambda: tuple(map(BlurAlong, _pixels_per_m(view), (-1, -2))))
        lit = light.flat > _LEAST_LIT * light.flat.max()
        entered = np.stack([np.where(lit, light.direct / np.where(lit, light.flat, 1.0), 0.0), lit]).astype(np.float32)
        blurred = (down(across(entered, width * length_m), width * length_m) for _, width in profile)
        return np.sum([weight * image for (weight, _), image in zip(profile, blurred, strict=True)], axis=0)

    choice = length_m, profile is _WITH_CORE
    return view.latest("light below", light, spread, choice=choice, most=_PROFILES_KEPT)


def _pixels_per_m(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Returns (pixels per metre along image columns, the same along rows) on the surface, [height][width] each, rms
    values. Slanted surfaces are foreshortened. Where nothing is hit, the farthest depth counts. Surfaces turned about
    both axes couple columns and rows; this is ignored."""
    hit, (x, y) = view.depth_m > 0, view.rays()
    along_x, along_y, along_z = np.moveaxis(view.normal, -1, 0)
    seen = (1.0 + ray**2 - (along - ray * along_z) ** 2 for ray, along in ((x, along_x), (y, along_y)))
    scale = 1.0 / np.where(hit, view.depth_m, view.depth_m.max() if hit.any() else 1.0)
    across, down = (k * scale * np.sqrt(np.maximum(s, 0.0)) for k, s in zip(np.diag(view.K)[:2], seen, strict=True))
    return across, down
