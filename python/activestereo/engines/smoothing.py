"""The renderer's noise in bounced and ambient light, filtered where such light follows the surface alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.engines.smooth import smooth_bounced

# Rougher surfaces have no highlight that would move through bounced light.
_MATT_ROUGHNESS = 0.5
_NOTHING_HIT = 0xFFFFFFFF
_SMOOTHED = ("projector_indirect", "ambient", "group", "added")


def smooth_view(view: dict[str, NDArray], camera: kuafu.Camera, scene: kuafu.Scene) -> dict[str, NDArray]:
    """A view's images [height][width][channels] with its bounced and ambient light smoothed on matt surfaces."""
    depth_m, material = view["depth"][..., 0], view["material_id"][..., 0]
    names = [name for name in _SMOOTHED if view[name].any()]
    if not names:
        return view
    points = np.where(depth_m[..., None] > 0, view["position"], 0.0)
    light = np.stack([view[name][..., 0] for name in names])
    smooth = smooth_bounced(light, depth_m, view["normal"], points, material, camera.k[0, 0])
    kept = np.where(np.isin(material, matt_materials(material, scene)), smooth, light)
    return view | {name: image[..., None] for name, image in zip(names, kept, strict=True)}


def matt_materials(material: NDArray[np.uint32], scene: kuafu.Scene) -> list[int]:
    """Ids of those whose bounced and ambient light follow the surface alone: no mirror, no glass, no albedo texture."""
    seen = {int(m): scene.get_material(int(m)) for m in np.unique(material) if m != _NOTHING_HIT}
    return [number for number, m in seen.items() if _is_matt(m)]


def _is_matt(m: kuafu.Material) -> bool:
    roughness = m.roughness if m.ir_roughness is None else m.ir_roughness
    transmission = m.transmission if m.ir_transmission is None else m.ir_transmission
    plain = m.base_color_texture is None or m.ir_albedo is not None
    return transmission == 0 and m.metallic == 0 and (roughness > _MATT_ROUGHNESS or m.specular == 0) and plain
