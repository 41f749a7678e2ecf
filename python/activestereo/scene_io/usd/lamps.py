# SPDX-License-Identifier: Apache-2.0
"""Converts a stage's lights to glTF's punctual lights, whose extras state their extent, and tubes to emissive surfaces.

USD's intensity times 2^exposure times colour is a luminance in nits; for a normalized distant light, an illuminance in
lux (UsdLuxLightAPI, "Quantities and Units"; ovrtx, "Light Units"). Dividing by LUMENS_PER_WATT makes it radiometric."""

from __future__ import annotations

from typing import Any

import numpy as np

from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.meshes import Mesh
from activestereo.scene_io.staging import LUMENS_PER_WATT, infrared_share
from activestereo.scene_io.usd.stage import Stage, UsdError

_LEAST_RADIUS = 1e-4  # in stage units; a lamp has an extent
_SHARE = "activestereo:ir_share"  # a light's attribute: a kind of lamp, or a number


def radiance(stage: Stage, api: Any) -> np.ndarray:
    """Returns a light's linear RGB radiance [3], W/(sr m^2), before `normalize` is applied. Raises UsdError if it is
    negative or not finite."""
    from pxr import UsdLux

    color = np.array(stage.value(api.GetColorAttr(), (1, 1, 1)), dtype=float)
    if stage.value(api.GetEnableColorTemperatureAttr(), False):
        kelvin = float(stage.value(api.GetColorTemperatureAttr(), 6500.0))
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin), dtype=float)  # of luminance 1
    for name, attribute in (("diffuse", api.GetDiffuseAttr()), ("specular", api.GetSpecularAttr())):
        if float(stage.value(attribute, 1.0)) != 1.0:
            stage.tell(f"{api.GetPath()}: inputs:{name}, which no lamp has, is not read")
    intensity, exposure = stage.value(api.GetIntensityAttr(), 1.0), stage.value(api.GetExposureAttr(), 0.0)
    with np.errstate(over="ignore", invalid="ignore"):
        light = color * float(intensity) * np.exp2(float(exposure)) / LUMENS_PER_WATT
    if not (np.isfinite(light).all() and np.all(light >= 0.0)):
        values = f"intensity {intensity:g}, exposure {exposure:g}, colour {', '.join(f'{c:g}' for c in color)}"
        raise UsdError(f"{stage.path}: {api.GetPath()}: {values} give no light: it must be finite and at least 0")
    return light


def add_lamp(stage: Stage, writer: GltfWriter, prim: Any, to_stage: np.ndarray, to_world: np.ndarray) -> None:
    """Adds a light other than a dome light to the glTF file. to_stage, to_world: 4x4 from the light to the stage's unit
    and to metres."""
    from pxr import UsdLux

    name, kind, api = str(prim.GetPath()), str(prim.GetTypeName()), UsdLux.LightAPI(prim)
    # 1. Its radiance, and the infrared share that the prim states, if it does.
    shines, share = radiance(stage, api), stage.value(prim.GetAttribute(_SHARE))
    normalize = bool(stage.value(api.GetNormalizeAttr(), False))
    try:
        extras: dict[str, Any] = {} if share is None else {"ir_share": infrared_share(str(share))}
    except ValueError as error:
        raise UsdError(f"{stage.path}: {name}.{_SHARE}: {error}") from error
    # 2. A distant light has an irradiance in place of an extent.
    axes = to_world.copy()
    axes[:3, :3] /= np.linalg.norm(to_world[:3, :3], axis=0)
    if prim.IsA(UsdLux.DistantLight):
        half = np.deg2rad(float(stage.value(UsdLux.DistantLight(prim).GetAngleAttr(), 0.53))) / 2
        irradiance = shines if normalize or half == 0 else shines * np.pi * np.sin(half) ** 2
        if half > np.deg2rad(0.5):
            stage.tell(f"{name}: light from {2 * np.rad2deg(half):.1f} degrees of the sky comes from its middle alone")
        writer.add_directional_light(name, axes, *_peak(irradiance), **extras)
        return
    if kind not in ("SphereLight", "DiskLight", "RectLight", "CylinderLight"):
        stage.tell(f"{name}: lights of type {kind} are not read")
        return
    # 3. A normalized light has the same power at any size in the stage's unit.
    if normalize:
        shines = shines / _extent(stage, prim, to_stage)[0]
    _, shown, size, tube = _extent(stage, prim, to_world)
    cone, (color, peak) = _cone(stage, prim), _peak(shines * shown)
    # 4. Kuafu has no light of a tube's shape: its surface shines.
    if tube is not None:
        if cone is not None:
            stage.tell(f"{name}: the cone of a {kind} is not read")
        color, peak = _peak(shines)
        # A surface's infrared light has no unit that follows the camera: imagers without a filter see all of it.
        material = writer.add_material(
            name,
            pbrMetallicRoughness={"baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0},
            emissiveFactor=color,
            extensions={
                "KHR_materials_emissive_strength": {"emissiveStrength": peak},
                "KHR_materials_specular": {"specularFactor": 0.0},
            },
            extras={"ir_emission": extras.get("ir_share", 1.0) * float(shines[0])},
        )
        writer.add_placed_mesh(name, tube, material, to_world)
    elif cone is not None:
        writer.add_spot_light(name, axes, color, peak, cone, **extras)
    elif kind == "SphereLight":
        writer.add_point_light(name, to_world[:3, 3].tolist(), color, peak, **(extras | size))
    else:
        writer.add_spot_light(name, axes, color, peak, (0.0, np.pi / 2), **(extras | size))


def _extent(stage: Stage, prim: Any, to: np.ndarray) -> tuple[float, float, dict[str, Any], Mesh | None]:
    """Returns a lamp's (emitting area, area seen from far away on its axis, extras for glTF's light, mesh of a tube's
    surface or None). to: 4x4 from the lamp's axes to axes in the unit of the areas."""
    from pxr import UsdLux

    kind, scales = str(prim.GetTypeName()), np.linalg.norm(to[:3, :3], axis=0)
    if kind == "RectLight":
        rect = UsdLux.RectLight(prim)
        if rect.GetTextureFileAttr() and stage.value(rect.GetTextureFileAttr()) is not None:
            stage.tell(f"{prim.GetPath()}: its texture is not read")
        size = np.array([float(stage.value(a, 1.0)) for a in (rect.GetWidthAttr(), rect.GetHeightAttr())])
        size = np.maximum(size, _LEAST_RADIUS) * scales[:2]
        return float(size.prod()), float(size.prod()), {"size_m": size.tolist()}, None
    light = getattr(UsdLux, kind)(prim)
    radius = max(float(stage.value(light.GetRadiusAttr(), 0.5)), _LEAST_RADIUS)
    if kind != "CylinderLight":
        is_disk = kind == "DiskLight"
        radius *= float(np.sqrt(np.prod(scales[:2])) if is_disk else np.cbrt(np.prod(scales)))
        disk = np.pi * radius**2
        return disk if is_disk else 4.0 * disk, disk, {"radius_m": radius}, None
    length = float(stage.value(light.GetLengthAttr(), 1.0))
    side = 2.0 * np.pi * radius * float(np.sqrt(np.prod(scales[1:]))) * length * float(scales[0])
    # The side of a cylinder along x; its ends do not shine.
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    out = np.stack([np.zeros(64), np.cos(angle), np.sin(angle)], axis=1)
    points = np.vstack([radius * out + [x, 0, 0] for x in (-length / 2, length / 2)])
    low, after = np.arange(64), np.roll(np.arange(64), -1)
    triangles = np.vstack([np.stack([low, after, low + 64], axis=1), np.stack([after, after + 64, low + 64], axis=1)])
    return side, side / np.pi, {}, Mesh.from_arrays(points, np.vstack([out, out]), np.zeros((128, 2)), triangles)


def _cone(stage: Stage, prim: Any) -> tuple[float, float] | None:
    """Returns the (inner, outer) half angle in radians of a light that shines into a cone, else None."""
    from pxr import UsdLux

    if not prim.HasAPI(UsdLux.ShapingAPI):
        return None
    shaping = UsdLux.ShapingAPI(prim)
    if stage.value(shaping.GetShapingIesFileAttr()) is not None:
        stage.tell(f"{prim.GetPath()}: its IES profile is not read")
    if float(stage.value(shaping.GetShapingFocusAttr(), 0.0)) != 0.0:
        stage.tell(f"{prim.GetPath()}: shaping:focus is not read")
    angle = float(stage.value(shaping.GetShapingConeAngleAttr(), 90.0))
    if not 0.0 < angle < 90.0:
        return None
    softness = min(max(float(stage.value(shaping.GetShapingConeSoftnessAttr(), 0.0)), 0.01), 1.0)
    return float(np.deg2rad(angle) * (1.0 - softness)), float(np.deg2rad(angle))


def _peak(light: np.ndarray) -> tuple[list[float], float]:
    """Splits RGB light into (colour with its largest channel 1, intensity), as glTF states it."""
    peak = max(float(light.max()), 1e-30)
    return (light / peak).tolist(), peak
