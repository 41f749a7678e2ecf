# SPDX-License-Identifier: Apache-2.0
"""Converts UsdPreviewSurface to glTF's materials."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from activestereo.scene_io.gltf_writer import CLAMP, MIRROR, REPEAT, GltfWriter
from activestereo.scene_io.usd.stage import Stage

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
        """Reads the number of a shader's input; tells that a texture there is not read, and takes `fallback`."""
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
                    data = data if image.format in ("PNG", "JPEG") else _png(image)
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
        """Returns the primvar that the input `key` reads, through at most eight transforms, since a file may connect
        them in a ring."""
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


def _png(image: Image.Image) -> bytes:
    out = io.BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


def _joined(parts: dict[str, Picture | None]) -> Picture | None:
    """Joins pictures into one glTF texture; None without pictures. parts: by role, 'color' and 'opacity' (its alpha),
    or 'roughness' and 'metallic' (its green and blue). A colour picture's own alpha is ignored."""
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
    return Picture(_png(image), name, source, image.mode.lower(), first.wrap, first.uv_name)
