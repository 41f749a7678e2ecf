# SPDX-License-Identifier: Apache-2.0
"""Converts UsdPreviewSurface to glTF's materials, tubes of light to emissive surfaces, and other lights to glTF's
punctual lights, whose extras state their extent.

USD's intensity times 2^exposure times colour is a luminance in nits; for a normalized distant light, an illuminance in
lux (UsdLuxLightAPI, "Quantities and Units"; ovrtx, "Light Units"). Dividing by LUMENS_PER_WATT makes it radiometric."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from activestereo.common.output_files import png_bytes
from activestereo.scene_io.gltf_writer import CLAMP, MIRROR, REPEAT, GltfWriter
from activestereo.scene_io.meshes import Mesh
from activestereo.scene_io.staging import LUMENS_PER_WATT, infrared_share
from activestereo.scene_io.usd.shapes import Stage, UsdError

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
        writer.add_light(name, axes, *_peak(irradiance), "directional", **extras)
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
        writer.add_light(name, axes, color, peak, "spot", cone, **extras)
    elif kind == "SphereLight":
        writer.add_light(name, to_world[:3, 3], color, peak, **(extras | size))
    else:
        writer.add_light(name, axes, color, peak, "spot", (0.0, np.pi / 2), **(extras | size))


def _extent(stage: Stage, prim: Any, to: np.ndarray) -> tuple[float, float, dict[str, Any], Mesh | None]:
    """Returns a lamp's (emitting area, its largest projected area, extras for glTF's light, mesh of a tube's surface or
    None). to: 4x4 from the lamp's axes to axes in the unit of the areas."""
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


_WRAPS = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP, "black": CLAMP}
_COLORS = ("diffuseColor", "emissiveColor")
_UNREADABLE = (UnidentifiedImageError, Image.DecompressionBombError, OSError, ValueError, SyntaxError)


@dataclass(frozen=True)
class Picture:
    """A texture image that feeds one input of a material, by one channel or as RGB."""

    data: bytes
    name: str
    source: str  # its identity: the file, or the files that it is made of
    channel: str  # r, g, b, a or rgb
    wrap: tuple[int, int]
    uv_name: str


class Surfaces:
    """Adds the materials of a stage's shapes to a glTF file, each material once."""

    def __init__(self, stage: Stage, writer: GltfWriter) -> None:
        self._stage, self._writer = stage, writer
        self._materials: dict[Any, tuple[int, str]] = {}
        self._textures: dict[Any, int] = {}
        self._files: dict[str, bytes | None] = {}

    def material_and_texture_coordinates(self, prim: Any, material: Any) -> tuple[int, str]:
        """Returns (index of glTF's material, primvar of its texture coordinates) for a material bound to a prim. A
        material that cannot be read gives a matt surface of the prim's displayColor."""
        name = str(material.GetPath()) if material else "displayColor"
        shader = material.ComputeSurfaceSource()[0] if material else None
        read = bool(shader) and shader.GetIdAttr().Get() == "UsdPreviewSurface"
        color = () if read else self._display_color(prim)
        key = (name, *color)
        if key not in self._materials:
            if read:
                self._materials[key] = self._preview(name, shader)
            else:
                if material:
                    self._stage.tell(f"{name}: only UsdPreviewSurface is read; it is matt, with the displayColor")
                pbr = {"baseColorFactor": [*color, 1.0], "metallicFactor": 0.0}
                self._materials[key] = self._writer.add_material(name, pbrMetallicRoughness=pbr), "st"
        return self._materials[key]

    def _display_color(self, prim: Any) -> tuple[float, ...]:
        from pxr import UsdGeom

        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        values = primvar.ComputeFlattened(self._stage.time) if primvar and primvar.HasValue() else None
        if values is None or not len(values):
            return (0.5, 0.5, 0.5)
        if len(values) > 1:
            self._stage.tell("of displayColor with many values the mean is taken")
        return tuple(np.clip(np.mean(np.asarray(values, dtype=float), axis=0), 0, 1).tolist())

    def _preview(self, name: str, shader: Any) -> tuple[int, str]:
        uv_names: list[str] = []

        def read(key: str, fallback: Any) -> tuple[Any, Picture | None]:
            value, picture = self._input(shader, key, fallback)
            if picture is not None:
                uv_names.append(picture.uv_name)
            return value, picture

        color, color_map = read("diffuseColor", (0.18, 0.18, 0.18))
        metallic, metallic_map = read("metallic", 0.0)
        roughness, roughness_map = read("roughness", 0.5)
        emission, emission_map = read("emissiveColor", (0.0, 0.0, 0.0))
        opacity, opacity_map = read("opacity", 1.0)
        color, emission = (
            [1.0, 1.0, 1.0] if picture else [float(c) for c in value]
            for value, picture in ((color, color_map), (emission, emission_map))
        )
        pbr: dict[str, Any] = {
            "baseColorFactor": [*color, 1.0 if opacity_map else float(opacity)],
            "metallicFactor": 1.0 if metallic_map else float(metallic),
            "roughnessFactor": 1.0 if roughness_map else float(roughness),
        }
        fields: dict[str, Any] = {"pbrMetallicRoughness": pbr, "emissiveFactor": emission}
        self._set_texture(pbr, "baseColorTexture", _joined({"color": color_map, "opacity": opacity_map}))
        rough_metal = _joined({"roughness": roughness_map, "metallic": metallic_map})
        self._set_texture(pbr, "metallicRoughnessTexture", rough_metal)
        self._set_texture(fields, "emissiveTexture", emission_map)
        self._set_texture(fields, "normalTexture", read("normal", None)[1])
        threshold = self._number(shader, "opacityThreshold", 0.0)
        if threshold > 0.0:
            fields.update(alphaMode="MASK", alphaCutoff=threshold)
        elif opacity_map is not None or float(opacity) < 1.0:
            fields["alphaMode"] = "BLEND"
        extensions: dict[str, Any] = {"KHR_materials_ior": {"ior": self._number(shader, "ior", 1.5)}}
        coat = self._number(shader, "clearcoat", 0.0)
        if coat > 0.0:
            rough = self._number(shader, "clearcoatRoughness", 0.01)
            fields_of_coat = {"clearcoatFactor": coat, "clearcoatRoughnessFactor": rough}
            if "normalTexture" in fields:  # a UsdPreviewSurface has one normal for both
                fields_of_coat["clearcoatNormalTexture"] = fields["normalTexture"]
            extensions["KHR_materials_clearcoat"] = fields_of_coat
        strength = max(fields["emissiveFactor"])
        if strength > 1.0:
            fields["emissiveFactor"] = [c / strength for c in fields["emissiveFactor"]]
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
        fields["extensions"] = extensions
        # Report the inputs that are not read.
        if int(self._value(shader, "useSpecularWorkflow", 0)):
            self._stage.tell(f"{name}: specularColor is not read; its metallic stands")
        for key in ("displacement", "occlusion"):
            if shader.GetInput(key) and shader.GetInput(key).HasConnectedSource():
                self._stage.tell(f"{name}: {key} is not read")
        others = sorted(set(uv_names) - set(uv_names[:1]))
        if others:
            self._stage.tell(f"{name}: its textures lie by {uv_names[0]}; {' and '.join(others)} are not read")
        return self._writer.add_material(name, **fields), uv_names[0] if uv_names else "st"

    def _set_texture(self, to: dict[str, Any], key: str, picture: Picture | None) -> None:
        if picture is None:
            return
        identity = (picture.source, picture.wrap)
        if identity not in self._textures:
            mime = "image/jpeg" if picture.data[:2] == b"\xff\xd8" else "image/png"
            self._textures[identity] = self._writer.add_texture(picture.data, picture.name, picture.wrap, mime)
        to[key] = {"index": self._textures[identity]}

    def _number(self, shader: Any, key: str, fallback: float) -> float:
        """Returns the number of a shader's input. For a texture it logs a message and returns `fallback`."""
        value, picture = self._input(shader, key, fallback)
        if picture is not None:
            self._stage.tell(f"{shader.GetPath()}.{key}: its texture is not read; it is {fallback:g}")
        return float(value)

    def _value(self, shader: Any, key: str, fallback: Any = None) -> Any:
        """Returns the value of an input, or of the material's input that it is connected to; `fallback` if a shader
        computes it."""
        from pxr import UsdShade

        entry = shader.GetInput(key)
        for attribute in UsdShade.Utils.GetValueProducingAttributes(entry) if entry else []:
            if not UsdShade.Output.IsOutput(attribute):
                return self._stage.value(attribute, fallback)
        return fallback

    def _input(self, shader: Any, key: str, fallback: Any) -> tuple[Any, Picture | None]:
        """Returns (value, picture) of an input; the picture is that of a connected UsdUVTexture, else None."""
        from pxr import UsdShade

        entry = shader.GetInput(key)
        if not entry:
            return fallback, None
        for attribute in UsdShade.Utils.GetValueProducingAttributes(entry):
            source = UsdShade.Shader(attribute.GetPrim())
            if source and source.GetIdAttr().Get() == "UsdUVTexture":
                channel = str(attribute.GetBaseName())
                picture = self._picture(source, channel, key)
                instead = self._value(source, "fallback") if picture is None else None
                if instead is None:
                    return fallback, picture
                return instead["rgba".index(channel)] if channel in tuple("rgba") else tuple(instead)[:3], None
            if UsdShade.Output.IsOutput(attribute):
                self._stage.tell(f"{shader.GetPath()}.{key}: only UsdUVTexture is read as its source")
                return fallback, None
            return self._stage.value(attribute, fallback), None
        return fallback, None

    def _picture(self, source: Any, channel: str, key: str) -> Picture | None:
        asset = self._value(source, "file")
        where = f"{source.GetPath()} of {key}"
        if asset is None:
            self._stage.tell(f"{where}: has no file")
            return None
        if not asset.resolvedPath:
            self._stage.tell(f"{where}: {asset.path} is not there; it is left out")
            return None
        if asset.resolvedPath not in self._files:
            from pxr import Ar

            # The file's bytes, made a PNG where it is of another kind.
            opened, data = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(asset.resolvedPath)), None
            try:
                if opened:
                    data = bytes(opened.GetBuffer())
                    image = Image.open(io.BytesIO(data))
                    image.load()
                    data = data if image.format in ("PNG", "JPEG") else png_bytes(image)
            except _UNREADABLE:
                data = None
            self._files[asset.resolvedPath] = data
        data = self._files[asset.resolvedPath]
        if data is None:
            self._stage.tell(f"{where}: {asset.path} is no image that can be read; it is left out")
            return None
        neutral = {"scale": (2, 2, 2, 2), "bias": (-1, -1, -1, -1)} if key == "normal" else {}
        for name, one in (("scale", (1, 1, 1, 1)), ("bias", (0, 0, 0, 0))):
            want = neutral.get(name, one)
            if not np.allclose(np.array(self._value(source, name, want), float)[:3], want[:3]):
                self._stage.tell(f"{where}: its {name} is not read")
        usual, other = ("sRGB", "raw") if key in _COLORS else ("raw", "sRGB")
        if channel != "a" and str(self._value(source, "sourceColorSpace", "auto")) == other:
            self._stage.tell(f"{where}: its sourceColorSpace is not read: it is taken as {usual}")
        wrap = tuple(_WRAPS.get(str(self._value(source, name, "repeat")), REPEAT) for name in ("wrapS", "wrapT"))
        uv_name = self._uv_name(source, "st", where)
        return Picture(data, asset.path, asset.resolvedPath, channel, (wrap[0], wrap[1]), uv_name)

    def _uv_name(self, source: Any, key: str, where: str, transforms: int = 0) -> str:
        """Returns the name of the primvar of texture coordinates that the input `key` reads, through at most eight
        transforms, because a file may connect them in a ring."""
        from pxr import UsdShade

        entry = source.GetInput(key)
        for attribute in UsdShade.Utils.GetValueProducingAttributes(entry) if entry else []:
            reader = UsdShade.Shader(attribute.GetPrim())
            kind = str(reader.GetIdAttr().Get()) if reader else ""
            if kind.startswith("UsdPrimvarReader"):
                return str(self._value(reader, "varname", "st"))
            if kind == "UsdTransform2d" and transforms < 8:
                self._stage.tell(f"{where}: a transform of its coordinates is not read")
                return self._uv_name(reader, "in", where, transforms + 1)
            self._stage.tell(f"{where}: its coordinates come from no primvar: st is taken")
        return "st"


def _open(picture: Picture) -> Image.Image:
    """Decodes a texture image to 8 bits per channel. It scales 16 bits, which Pillow would clip."""
    image = Image.open(io.BytesIO(picture.data))
    if image.mode.startswith("I"):
        return Image.fromarray((np.asarray(image).astype(np.int64) >> 8).clip(0, 255).astype(np.uint8))
    return image


def _joined(parts: dict[str, Picture | None]) -> Picture | None:
    """Joins pictures into one glTF texture image; None without pictures. parts: by role, 'color' and 'opacity' (its
    alpha), or 'roughness' and 'metallic' (its green and blue). A colour picture's own alpha is ignored."""
    used = {role: part for role, part in parts.items() if part is not None}
    if not used:
        return None
    first, sizes = next(iter(used.values())), np.array([_open(part).size for part in used.values()])
    size = int(sizes[:, 0].max()), int(sizes[:, 1].max())

    def channel(role: str) -> Image.Image:
        """Returns the image for a role such as 'opacity' as one 8-bit channel, white if there is none."""
        if role not in used:
            return Image.new("L", size, 255)
        bands = _open(used[role]).convert("RGBA").resize(size).split()
        return bands[{"g": 1, "b": 2, "a": 3}.get(used[role].channel, 0)]

    if "color" in parts:
        image = _open(first)
        if list(used) == ["color"] and "A" not in image.getbands() and "transparency" not in image.info:
            return first
        white = Image.new("RGB", size, (255, 255, 255))
        image = image.convert("RGB").resize(size) if "color" in used else white
        if "opacity" in used:
            image = Image.merge("RGBA", [*image.split(), channel("opacity")])
    else:
        image = Image.merge("RGB", [Image.new("L", size, 255), channel("roughness"), channel("metallic")])
    name = "|".join(f"{role} {part.name}.{part.channel}" for role, part in used.items())
    source = "|".join(f"{role} {part.source}.{part.channel}" for role, part in used.items())
    return Picture(png_bytes(image), name, source, image.mode.lower(), first.wrap, first.uv_name)
