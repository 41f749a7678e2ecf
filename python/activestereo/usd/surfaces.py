# SPDX-License-Identifier: Apache-2.0
"""UsdPreviewSurface as glTF's materials."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from activestereo.gltf_writer import CLAMP, MIRROR, REPEAT, GltfWriter
from activestereo.usd.stage import Stage

_WRAPS = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP, "black": CLAMP}
_IGNORED = ("displacement", "occlusion")


@dataclass(frozen=True)
class Picture:
    """A texture that feeds an input, by one channel or all."""

    data: bytes
    name: str
    channel: str  # r, g, b, a or rgb
    wrap: tuple[int, int]
    uv_name: str


class Surfaces:
    """The materials that a stage's shapes ask for, each added once."""

    def __init__(self, stage: Stage, writer: GltfWriter) -> None:
        self._stage, self._writer = stage, writer
        self._materials: dict[Any, tuple[int, str]] = {}
        self._textures: dict[Any, int] = {}

    def of(self, prim: Any, material: Any) -> tuple[int, str]:
        """(glTF's material, the primvar of its texture coordinates) for what `material` is bound to; an invalid one
        gives a matt surface of the prim's displayColor."""
        key = material.GetPath() if material else ("display", *self._display_color(prim))
        if key not in self._materials:
            shader = material.ComputeSurfaceSource()[0] if material else None
            if shader and shader.GetIdAttr().Get() == "UsdPreviewSurface":
                self._materials[key] = self._preview(str(material.GetPath()), shader)
            else:
                if material:
                    self._stage.tell(f"{material.GetPath()}: only UsdPreviewSurface is read; it is shown grey and matt")
                pbr = {"baseColorFactor": [*self._display_color(prim), 1.0], "metallicFactor": 0.0}
                name = str(material.GetPath()) if material else "displayColor"
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
        pbr: dict[str, Any] = {
            "baseColorFactor": [*_rgb(color, color_map), 1.0 if opacity_map else float(opacity)],
            "metallicFactor": 1.0 if metallic_map else float(metallic),
            "roughnessFactor": 1.0 if roughness_map else float(roughness),
        }
        fields: dict[str, Any] = {"pbrMetallicRoughness": pbr, "emissiveFactor": _rgb(emission, emission_map)}
        self._put(pbr, "baseColorTexture", _with_alpha(color_map, opacity_map))
        self._put(pbr, "metallicRoughnessTexture", _packed(roughness_map, metallic_map))
        self._put(fields, "emissiveTexture", emission_map)
        self._put(fields, "normalTexture", read("normal", None)[1])
        self._opacity(shader, fields, opacity, opacity_map)
        self._extensions(shader, name, fields)
        return self._writer.add_material(name, **fields), uv_names[0] if uv_names else "st"

    def _opacity(self, shader: Any, fields: dict[str, Any], opacity: Any, opacity_map: Picture | None) -> None:
        threshold = float(self._input(shader, "opacityThreshold", 0.0)[0])
        if threshold > 0.0:
            fields.update(alphaMode="MASK", alphaCutoff=threshold)
        elif opacity_map is not None or float(opacity) < 1.0:
            fields["alphaMode"] = "BLEND"

    def _extensions(self, shader: Any, name: str, fields: dict[str, Any]) -> None:
        extensions: dict[str, Any] = {"KHR_materials_ior": {"ior": float(self._input(shader, "ior", 1.5)[0])}}
        coat = float(self._input(shader, "clearcoat", 0.0)[0])
        if coat > 0.0:
            rough = float(self._input(shader, "clearcoatRoughness", 0.01)[0])
            extensions["KHR_materials_clearcoat"] = {"clearcoatFactor": coat, "clearcoatRoughnessFactor": rough}
        strength = max(fields["emissiveFactor"])
        if strength > 1.0:
            fields["emissiveFactor"] = [c / strength for c in fields["emissiveFactor"]]
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
        if int(self._input(shader, "useSpecularWorkflow", 0)[0]):
            self._stage.tell(f"{name}: specularColor is not read; its metallic stands")
        fields["extensions"] = extensions
        for key in _IGNORED:
            if key == "displacement" and shader.GetInput(key) and shader.GetInput(key).HasConnectedSource():
                self._stage.tell(f"{name}: displacement is not read")

    def _put(self, to: dict[str, Any], key: str, picture: Picture | None) -> None:
        if picture is None:
            return
        identity = (picture.name, picture.channel, picture.wrap)
        if identity not in self._textures:
            mime = "image/jpeg" if picture.data[:2] == b"\xff\xd8" else "image/png"
            self._textures[identity] = self._writer.add_texture(picture.data, picture.name, picture.wrap, mime)
        to[key] = {"index": self._textures[identity]}

    def _input(self, shader: Any, key: str, fallback: Any) -> tuple[Any, Picture | None]:
        """(value, picture): the picture of a UsdUVTexture where one is connected, else None."""
        from pxr import UsdShade

        entry = shader.GetInput(key)
        if not entry:
            return fallback, None
        for attribute in UsdShade.Utils.GetValueProducingAttributes(entry):
            source = UsdShade.Shader(attribute.GetPrim())
            if source and source.GetIdAttr().Get() == "UsdUVTexture":
                return fallback, self._picture(source, str(attribute.GetBaseName()), key)
            if attribute.GetName().startswith("outputs:"):
                self._stage.tell(f"{shader.GetPath()}.{key}: only UsdUVTexture is read as its source")
                return fallback, None
            return self._stage.value(attribute, fallback), None
        return fallback, None

    def _picture(self, source: Any, channel: str, key: str) -> Picture | None:
        from pxr import Ar

        def value(name: str, default: Any = None) -> Any:
            entry = source.GetInput(name)
            return default if not entry else self._stage.value(entry.GetAttr(), default)

        asset = value("file")
        where = f"{source.GetPath()} of {key}"
        if asset is None:
            self._stage.tell(f"{where}: has no file")
            return None
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(asset.resolvedPath)) if asset.resolvedPath else None
        if not opened:
            self._stage.tell(f"{where}: {asset.path} is not there; it is left out")
            return None
        data = bytes(opened.GetBuffer())
        if data[:8] != b"\x89PNG\r\n\x1a\n" and data[:2] != b"\xff\xd8":
            try:
                data = _png(Image.open(io.BytesIO(data)))
            except (UnidentifiedImageError, OSError, ValueError):
                self._stage.tell(f"{where}: {asset.path} is no image that can be read; it is left out")
                return None
        neutral = {"scale": (2, 2, 2, 2), "bias": (-1, -1, -1, -1)} if key == "normal" else {}
        for name, one in (("scale", (1, 1, 1, 1)), ("bias", (0, 0, 0, 0))):
            want = neutral.get(name, one)
            if not np.allclose(np.array(value(name, want), float)[:3], want[:3]):
                self._stage.tell(f"{where}: its {name} is not read")
        wrap = tuple(_WRAPS.get(str(value(name, "repeat")), REPEAT) for name in ("wrapS", "wrapT"))
        return Picture(data, asset.path, channel, (wrap[0], wrap[1]), self._uv_name(source, where))

    def _uv_name(self, source: Any, where: str) -> str:
        from pxr import UsdShade

        entry = source.GetInput("st")
        for attribute in UsdShade.Utils.GetValueProducingAttributes(entry) if entry else []:
            reader = UsdShade.Shader(attribute.GetPrim())
            if reader and str(reader.GetIdAttr().Get()).startswith("UsdPrimvarReader"):
                return str(self._stage.value(reader.GetInput("varname").GetAttr(), "st"))
            self._stage.tell(f"{where}: a transform of its coordinates is not read")
        return "st"


def _rgb(value: Any, picture: Picture | None) -> list[float]:
    return [1.0, 1.0, 1.0] if picture else [float(c) for c in value]


def _png(image: Image.Image) -> bytes:
    out = io.BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


def _channel(picture: Picture | None, size: tuple[int, int]) -> Image.Image:
    """One channel as grey; white where there is no picture."""
    if picture is None:
        return Image.new("L", size, 255)
    bands = Image.open(io.BytesIO(picture.data)).convert("RGBA").resize(size).split()
    return bands[{"g": 1, "b": 2, "a": 3}.get(picture.channel, 0)]


def _size(*pictures: Picture | None) -> tuple[int, int]:
    sizes = [Image.open(io.BytesIO(p.data)).size for p in pictures if p is not None]
    return max(s[0] for s in sizes), max(s[1] for s in sizes)


def _packed(roughness: Picture | None, metallic: Picture | None) -> Picture | None:
    """glTF's texture: roughness in green, metallic in blue. The picture of both where it is that already."""
    first = roughness or metallic
    if first is None:
        return None
    size = _size(roughness, metallic)
    bands = [Image.new("L", size, 255), _channel(roughness, size), _channel(metallic, size)]
    name = "|".join(f"{p.name}.{p.channel}" for p in (roughness, metallic) if p is not None)
    return Picture(_png(Image.merge("RGB", bands)), name, "rgb", first.wrap, first.uv_name)


def _with_alpha(color: Picture | None, opacity: Picture | None) -> Picture | None:
    """glTF's texture: colour, and opacity in alpha."""
    first = color or opacity
    if opacity is None or first is None:
        return color
    size = _size(color, opacity)
    rgb = Image.new("RGB", size, (255, 255, 255))
    if color is not None:
        rgb = Image.open(io.BytesIO(color.data)).convert("RGB").resize(size)
    image = Image.merge("RGBA", [*rgb.split(), _channel(opacity, size)])
    return Picture(_png(image), f"{first.name}|{opacity.name}.{opacity.channel}", "rgba", first.wrap, first.uv_name)
