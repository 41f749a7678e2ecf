# SPDX-License-Identifier: Apache-2.0
"""The projector's light on what a camera sees, and the room's: one reflection, the laws of kuafu's shaders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.lens import pixel_rays
from activestereo.common.pose import camera_to_camera
from activestereo.effects.core.ggx import Cosines, base_share, cosines_of, highlight, reflected_share
from activestereo.effects.core.resample import Pattern, blur, disc_sampler
from activestereo.sensor.gbuffer.buffers import Floats, GBuffer

# A bilinear lookup widens a dot by this variance more than the box means do that are taken here, px^2.
_BILINEAR_VARIANCE = 1.0 / 12.0
# A surface's own shadow: it has to lie so far behind what hides it.
_BEHIND_SHARE, _BEHIND_M = 0.01, 0.01
_LEAST_ROUGHNESS = 0.03
_OPTICS = ("vignetting_exponent", "psf_sigma_px", "firefly_factor")


@dataclass(frozen=True)
class Eye:
    """One infrared camera: rays [height, width, 3] with z = 1, the factor of its vignetting [height, width], and its
    axes to the projector's."""

    rays: Floats
    vignetting: Floats
    to_projector: Floats
    k: Floats


def eye_of(config: StereoDepthSensorConfig, is_right: bool) -> Eye:
    k, _ = config.ir_intrinsics(is_right)
    width, height = config.ir_resolution
    v, u = np.indices((height, width))
    rays = np.moveaxis(pixel_rays(u.ravel(), v.ravel(), k, (0.0,) * 5).reshape(3, height, width), 0, -1)
    exponent = (config.ir_optics or {}).get("vignetting_exponent", 0.0)
    place = config.trans_pose_r if is_right else config.trans_pose_l
    vignetting = np.linalg.norm(rays, axis=-1) ** -exponent
    return Eye(rays, vignetting, camera_to_camera(place, config.pose_rgb_irproj), np.asarray(k))


class ProjectedLight:
    """Radiance at the imagers. ValueError for optics and projectors that have no law here."""

    def __init__(self, config: StereoDepthSensorConfig) -> None:
        neutral, optics = kuafu.Optics(), config.ir_optics or {}
        for name, value in optics.items():
            if name not in _OPTICS and value != getattr(neutral, name):
                known = ", ".join(_OPTICS)
                raise ValueError(f"ir_optics[{name!r}] is {value}: a sensor on G-buffers has {known} alone")
        if config.light_dots is not None:
            raise ValueError("light_dots: a sensor on G-buffers has pattern images alone: set light_pattern")
        self._psf_sigma_px = optics.get("psf_sigma_px", 0.0)
        self._falloff, self._beam_m = config.projector_falloff, config.projector_beam_radius_m
        self._pattern: Pattern | None = None
        found = config.pattern()
        if found is not None:
            image, k = found
            side = _BILINEAR_VARIANCE / 2.0
            kernel = np.array([side, 1.0 - 2.0 * side, side])
            smooth = convolve1d(convolve1d(image / 255.0, kernel, 0, mode="constant"), kernel, 1, mode="constant")
            self._pattern, self._k = Pattern(smooth), np.array(k)
            self._k[:2, :2] *= config.light_pattern_scale

    def seen(
        self, eye: Eye, seen: GBuffer, is_lit: NDArray[np.bool_], intensity: Floats, ambient: Floats
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(all light, the projector's part), float32 [E, height, width] W/(sr m^2). intensity [E]: W/sr where the
        pattern is 1; ambient [E, 1, 1] or [E, height, width]: radiance from all sides."""
        is_hit = seen.inverse_depth > 0.0
        points = eye.rays / np.where(is_hit, seen.inverse_depth, 1.0)[..., None]
        to_camera = np.broadcast_to(-eye.rays / np.linalg.norm(eye.rays, axis=-1, keepdims=True), points.shape)
        laser = np.zeros(is_hit.shape)
        source = np.linalg.inv(eye.to_projector)[:3, 3]
        way = source - points
        distance = np.maximum(np.linalg.norm(way, axis=-1), 1e-6)
        cosines = cosines_of(seen.normal, way / distance[..., None], to_camera)
        reflected, of_room = _reflectance(seen, cosines)
        if self._pattern is not None:
            z = points @ eye.to_projector[2, :3] + eye.to_projector[2, 3]
            is_ahead = is_hit & (z > 1e-6)
            dots = np.where(is_ahead, self._dots(eye, points, np.where(is_ahead, z, 1.0)), 0.0)
            fall = np.where(is_ahead, z / distance, 0.0) ** self._falloff if self._falloff else 1.0
            laser = intensity[:, None, None] * dots * fall * cosines.n_l / distance**2 * reflected * is_lit
        light = laser + np.where(is_hit, of_room, 1.0) * ambient
        return self._through_lens(light, eye), self._through_lens(laser, eye)

    def _dots(self, eye: Eye, points: Floats, z: Floats) -> Floats:
        """The pattern's mean over each pixel's footprint, through the beams' width."""
        q = points @ eye.to_projector[:2, :3].T + eye.to_projector[:2, 3]
        k = self._k
        v = k[1, 1] * q[..., 1] / z + k[1, 2]
        u = (k[0, 0] * q[..., 0] + k[0, 1] * q[..., 1]) / z + k[0, 2]
        ratio_u, ratio_v = k[0, 0] / eye.k[0, 0], k[1, 1] / eye.k[1, 1]
        step = np.abs(np.diff(u, axis=-1))  # along epipolar lines it depends on slant; edges must not open it
        sides = [np.pad(step, ((0, 0), (0, 0), pad), "edge") for pad in ((1, 0), (0, 1))]
        box_u = np.clip(np.minimum(*sides), 0.25 * ratio_u, 4.0 * ratio_u)
        box_v = np.full(u.shape, ratio_v)
        assert self._pattern is not None
        if not self._beam_m:
            return np.asarray(disc_sampler(self._pattern, 0.0)(u, v, box_u, box_v))
        diameter = 2.0 * self._beam_m * k[0, 0] / z
        diameter = np.minimum(diameter, 64.0)
        low = np.floor(diameter).astype(int)
        share, out = diameter - low, np.zeros(u.shape)
        for level in np.unique([low, low + 1]):
            weight = np.where(low == level, 1.0 - share, np.where(low + 1 == level, share, 0.0))
            here = weight > 0.0
            sampler = disc_sampler(self._pattern, float(level))
            out[here] += weight[here] * sampler(u[here], v[here], box_u[here], box_v[here])
        return out

    def _through_lens(self, light: Floats, eye: Eye) -> NDArray[np.float32]:
        dimmed = (light * eye.vignetting).astype(np.float32)
        return np.ascontiguousarray(blur(dimmed, self._psf_sigma_px) if self._psf_sigma_px else dimmed, np.float32)


def lit_by_projector(
    seen: GBuffer, eye: Eye, beside_m: float, shift_px: float, nearest: Floats
) -> NDArray[np.bool_]:
    """[E, height, width]: what nothing nearer hides from the projector, which stands beside_m to the right of the eye.
    nearest: inverse depth [E, height, width] as a camera like this eye in the projector's place sees it, whose
    principal point lies shift_px further left."""
    width = nearest.shape[-1]
    x = np.arange(width) - shift_px - eye.k[0, 0] * beside_m * seen.inverse_depth
    left = np.clip(np.floor(x), 0, width - 1).astype(np.intp)
    beside = np.minimum(left + 1, width - 1)
    hiding = np.minimum(*(np.take_along_axis(nearest, place, axis=-1) for place in (left, beside)))
    own, other = seen.inverse_depth, hiding
    # z < z_other (1 + share) + m, in inverse depths; nothing hides what lies beside the image.
    is_lit = other <= own * (1.0 + _BEHIND_SHARE + _BEHIND_M * other)
    return np.asarray(is_lit | (x < -1.0) | (x > width) | (own == 0.0))


def _reflectance(seen: GBuffer, cosines: Cosines) -> tuple[Floats, Floats]:
    """(radiance per irradiance of a light from one direction, radiance per radiance of light from all sides)."""
    n_h, n_l, n_v, h_v = (np.asarray(cosine) for cosine in cosines)
    one_way = seen.albedo / np.pi * (1.0 - seen.metallic) * (1.0 - seen.transmission)
    of_room = one_way * np.pi
    coated = (seen.specular > 0.0) & (seen.metallic < 1.0)
    kinds = np.unique(np.stack([seen.roughness[coated], seen.specular[coated]], axis=1), axis=0)
    for roughness, factor in kinds.tolist():
        here = coated & (seen.roughness == roughness) & (seen.specular == factor)
        own, back, away = max(roughness, _LEAST_ROUGHNESS), n_l[here], n_v[here]
        share = factor * (1.0 - seen.metallic[here])
        lobe = highlight(Cosines(n_h[here], back, away, h_v[here]), own) * share
        one_way[here] = one_way[here] * base_share(back, away, own, factor) + lobe
        shine = reflected_share(away, own)
        of_room[here] = of_room[here] * (1.0 - factor * shine) + share * shine
    metal = seen.metallic > 0.0
    if metal.any():
        square = np.maximum(seen.roughness[metal], _LEAST_ROUGHNESS) ** 4
        h, light, view = n_h[metal], n_l[metal], n_v[metal]
        density = square / (np.pi * (h * h * (square - 1.0) + 1.0) ** 2)
        masked = light * np.sqrt(view * view * (1.0 - square) + square)
        masked = masked + view * np.sqrt(light * light * (1.0 - square) + square)
        fresnel = seen.albedo[metal] + (1.0 - seen.albedo[metal]) * (1.0 - h_v[metal]) ** 5
        lobe = np.where((light > 0) & (view > 0), fresnel * density * 0.5 / np.maximum(masked, 1e-6), 0.0)
        one_way[metal] += seen.metallic[metal] * lobe
        of_room[metal] += seen.metallic[metal] * seen.albedo[metal]
    return one_way, of_room
