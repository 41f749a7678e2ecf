# SPDX-License-Identifier: Apache-2.0
"""The images that a simulator gives of one camera are checked and brought to the host."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.nearest import unknown
from activestereo.sensor.gbuffer.rig import inverse_depth

Floats = NDArray[np.float64]
# Normals are unit vectors but for the rounding of 8-bit and half-precision images.
_UNIT = 0.02
KINDS = ("planar", "ray")


@dataclass(frozen=True)
class GBuffer:
    """All [E, height, width] of one camera. inverse_depth: 1 / planar depth, 0 where nothing is. normal [..., 3]: unit,
    in the camera's axes (x right, y down, z forward), towards the camera. The rest is as kuafu.Material has it in the
    infrared."""

    inverse_depth: Floats
    normal: Floats
    albedo: Floats
    roughness: Floats
    metallic: Floats
    specular: Floats
    transmission: Floats

    def taken(self, inverse_depth: Floats, pixel: NDArray[np.intp]) -> GBuffer:
        """The same surfaces seen elsewhere. pixel: of each place, the flat index of the pixel that has its surface."""
        rest = (self.albedo, self.roughness, self.metallic, self.specular, self.transmission)
        return GBuffer(inverse_depth, self.normal.reshape(-1, 3)[pixel], *(image.ravel()[pixel] for image in rest))


def host_image(name: str, values: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """An array of NumPy, torch, or what speaks DLPack, of this shape; a missing axis of one environment is added.
    ValueError for another shape, TypeError for what is no array of numbers."""
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    elif hasattr(values, "__dlpack__") and not isinstance(values, np.ndarray):
        values = np.from_dlpack(values)
    image = np.asarray(values)
    if image.dtype.kind not in "fiub":
        raise TypeError(f"{name} is of {image.dtype}, expected numbers")
    if shape[0] == 1 and image.shape == shape[1:]:
        image = image[None]
    if image.shape != shape:
        raise ValueError(f"{name} is {list(image.shape)}, expected {list(shape)}")
    return image


def read_gbuffer(
    buffers: Mapping[str, Any], shape: tuple[int, ...], rays: Floats, depth_kind: str, materials: SurfaceTable
) -> GBuffer:
    """buffers: depth, and normal, albedo, material or None. rays [height, width, 3]: where pixels look, z = 1.
    ValueError names the environment, the pixel and the value that cannot be."""
    if depth_kind not in KINDS:
        raise ValueError(unknown("depth_kind", depth_kind, KINDS))
    depth = host_image("depth", buffers["depth"], shape).astype(np.float64)
    depth[np.isposinf(depth)] = 0.0  # nothing there, as simulators have it
    _require(np.isfinite(depth) & (depth >= 0.0), "depth", depth, "metres from 0 on, 0 or inf = nothing there")
    if depth_kind == "ray":
        depth /= np.linalg.norm(rays, axis=-1)
    inverse = inverse_depth(depth)
    normal = buffers.get("normal")
    if normal is None:
        normal = _normals_of(depth, rays)
    else:
        normal = host_image("normal", normal, (*shape, 3)).astype(np.float64)
        length = np.linalg.norm(normal, axis=-1)
        _require((np.abs(length - 1.0) < _UNIT) | (depth == 0.0), "the length of normal", length, "unit vectors")
    facing = (normal * rays).sum(axis=-1) > 0.0
    return materials.surfaces(buffers, shape, inverse, np.where(facing[..., None], -normal, normal))


class SurfaceTable:
    """materials: kuafu.Materials by number, a sequence or a mapping; None = all matt."""

    def __init__(self, materials: Any = None) -> None:
        if materials is None:
            self._materials: dict[int, kuafu.Material] | None = None
            return
        found = materials.items() if isinstance(materials, Mapping) else enumerate(materials)
        self._materials = {int(number): material for number, material in found}
        for number, material in self._materials.items():
            if not isinstance(material, kuafu.Material):
                raise TypeError(f"materials[{number}] is {material!r}, expected a kuafu.Material")

    def surfaces(self, buffers: Mapping[str, Any], shape: tuple[int, ...], inverse: Floats, normal: Floats) -> GBuffer:
        """A material's ir_albedo holds; where it has none the albedo image does (of RGB the red channel, a guess), or
        else its base colour's red."""
        image = _albedo_image(buffers.get("albedo"), shape, inverse)
        number = buffers.get("material")
        if self._materials is None:
            if number is not None:
                raise ValueError("material is given, but this sensor was made without materials=")
            if image is None:
                raise ValueError("albedo is missing: give it, or material with materials= of the sensor")
            full = [np.full(shape, value) for value in (1.0, 0.0, 0.0, 0.0)]
            return GBuffer(inverse, normal, image, *full)
        if number is None:
            raise ValueError("material is missing: this sensor was made with materials=")
        numbers = host_image("material", number, shape)
        known = np.array(sorted(self._materials))
        place = np.clip(np.searchsorted(known, numbers), 0, len(known) - 1)
        _require((known[place] == numbers) | (inverse == 0.0), "material", numbers, f"a number of materials {known}")
        rows = [self._materials[int(n)] for n in known]
        measured = np.array([np.nan if m.ir_albedo is None else m.ir_albedo for m in rows])[place]
        red = np.array([m.base_color[0] for m in rows])[place]
        albedo = np.where(np.isnan(measured), red if image is None else image, measured)
        own = {
            name: np.array([getattr(m, name) for m in rows])[place]
            for name in ("roughness", "metallic", "specular", "transmission")
        }
        return GBuffer(inverse, normal, albedo, **own)


def _albedo_image(values: Any, shape: tuple[int, ...], inverse: Floats) -> Floats | None:
    if values is None:
        return None
    is_rgb = np.ndim(values) > 1 and np.shape(values)[-1] in (3, 4) and len(np.shape(values)) > len(shape[1:])
    is_rgb = is_rgb and np.shape(values)[-3:-1] == shape[1:]
    channels = np.shape(values)[-1]
    image = host_image("albedo", values, (*shape, channels))[..., 0] if is_rgb else host_image("albedo", values, shape)
    image = image / 255.0 if image.dtype == np.uint8 else image.astype(np.float64)
    _require(((image >= 0.0) & (image <= 1.0)) | (inverse == 0.0), "albedo", image, "0 to 1")
    return np.where(inverse > 0.0, image, 0.0)


def _normals_of(depth: Floats, rays: Floats) -> Floats:
    """Normals of planes through each pixel's neighbours."""
    points = depth[..., None] * rays
    across = np.cross(np.gradient(points, axis=-3), np.gradient(points, axis=-2))
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    to_camera = -rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.where(length > 1e-12, across / np.maximum(length, 1e-12), to_camera)


def _require(is_right: NDArray[np.bool_], name: str, values: NDArray[Any], expected: str) -> None:
    if is_right.all():
        return
    environment, v, u = (int(i) for i in np.unravel_index(int(np.argmin(is_right)), is_right.shape))
    bad = np.flatnonzero(~is_right.all(axis=(1, 2))).tolist()
    more = f" (and in environments {bad[1:9]})" if len(bad) > 1 else ""
    value = values[environment, v, u]
    raise ValueError(f"environment {environment}, pixel ({u}, {v}): {name} is {value}, expected {expected}{more}")
