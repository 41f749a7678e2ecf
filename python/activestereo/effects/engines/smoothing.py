# SPDX-License-Identifier: Apache-2.0
"""The renderer's noise in bounced and ambient light, filtered where such light follows the surface alone.

Direct light has edges of its own: shadows of lamps, dots of further projectors. It is never filtered.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.effects.engines.smooth import Surfaces, smooth_bounced

# Rougher surfaces have no highlight that would move through bounced light.
_MATT_ROUGHNESS = 0.5
_NOTHING_HIT = 0xFFFFFFFF
_EVEN = ("ambient", "ambient_direct")
# Below a surface that lets light wander, these hold the dots.
_BOUNCED = ("projector_indirect", "added_indirect")


def seen_surfaces(scene: kuafu.Scene, material: NDArray[np.uint32]) -> dict[int, kuafu.Material]:
    """The scene's materials whose ids are in an image of any shape, by their id. A scene is one thread's at a time:
    read them before images are smoothed in several threads."""
    return {int(m): scene.get_material(int(m)) for m in np.unique(material) if m != _NOTHING_HIT}


def smooth_view(
    view: dict[str, NDArray], camera: kuafu.Camera, surfaces: Mapping[int, kuafu.Material]
) -> dict[str, NDArray]:
    """A view's images [height][width][channels] with its bounced and ambient light smoothed on matt surfaces."""
    depth_m, material = view["depth"][..., 0], view["material_id"][..., 0]
    light = {name: view[name][..., 0] for name in (*_EVEN, *_BOUNCED) if name in view and view[name].any()}
    points = np.where(depth_m[..., None] > 0, view["position"], 0.0)
    smooth = smooth_light(light, depth_m, view["normal"], points, material, camera.k[0, 0], surfaces)
    return view | {name: image[..., None] for name, image in smooth.items()}


def smooth_light(
    light: dict[str, NDArray],
    depth_m: NDArray,
    normal: NDArray,
    points: NDArray,
    material: NDArray[np.uint32],
    focal_px: float,
    surfaces: Mapping[int, kuafu.Material],
) -> dict[str, NDArray]:
    """Images [height][width] of bounced and ambient light, by their output's name, smoothed on matt surfaces. normal
    and points [height][width][3] in one frame; material: ids; surfaces: at least those materials, by id."""
    is_matt = np.isin(material, [number for number, m in surfaces.items() if is_matt_surface(m)])
    if not light or not is_matt.any():
        return light
    smooth = smooth_bounced(np.stack(list(light.values())), Surfaces.of(depth_m, normal, points, material), focal_px)
    is_opaque = is_matt & np.isin(material, [number for number, m in surfaces.items() if m.subsurface == 0])
    return {
        name: np.where(is_matt if name in _EVEN else is_opaque, filtered, raw)
        for (name, raw), filtered in zip(light.items(), smooth, strict=True)
    }


def is_matt_surface(m: kuafu.Material) -> bool:
    """Whether bounced and ambient light follow the surface alone: no mirror, no glass, no albedo texture."""
    roughness = m.roughness if m.ir_roughness is None else m.ir_roughness
    transmission = m.transmission if m.ir_transmission is None else m.ir_transmission
    plain = m.base_color_texture is None or m.ir_albedo is not None
    return transmission == 0 and m.metallic == 0 and (roughness > _MATT_ROUGHNESS or m.specular == 0) and plain
