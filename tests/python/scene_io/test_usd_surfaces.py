# SPDX-License-Identifier: Apache-2.0
"""USD as exporters write it: each body, material and texture is read, or left out in a line."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb_file import Glb
from PIL import Image

import kuafu
from activestereo.scene_io.usd import UsdError, convert, load_usd

pxr = pytest.importorskip("pxr", reason="the package usd-core is not installed (pip install usd-core)")

_POINTS = "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]"
_QUAD = f" int[] faceVertexCounts = [4]\n int[] faceVertexIndices = [0, 1, 2, 3]\n {_POINTS}\n"
_MESH = f'def Mesh "M"\n{{\n{_QUAD}}}\n'


def _stage(folder: Path, body: str) -> Path:
    path = folder / "a.usda"
    path.write_text('#usda 1.0\n(\n metersPerUnit = 1\n upAxis = "Y"\n)\n' + body)
    return path


_TILTED = "(0.6, 0, 0.8)"


@pytest.mark.parametrize(
    ("normals", "tilted", "said"),
    [
        (f"normal3f[] normals = [{', '.join([_TILTED] * 4)}]", True, ""),
        (f"double3[] normals = [{', '.join([_TILTED] * 4)}]", True, ""),
        (f'normal3f[] normals = [{", ".join([_TILTED] * 4)}] (interpolation = "faceVarying")', True, ""),
        (f'normal3f[] normals = [{_TILTED}] (interpolation = "uniform")', True, ""),
        (f'normal3f[] normals = [{_TILTED}] (interpolation = "constant")', True, ""),
        (f"normal3f[] normals = [{_TILTED}]", False, "its 1 normals are left out"),
        (f"normal3f[] normals = [{', '.join([_TILTED] * 6)}]", False, "its 6 normals are left out"),
        (f"normal3f normals = {_TILTED}", False, "normals is left out: it is no array of vectors of 3 numbers"),
        ("int normals = 7", False, "normals is left out"),
        ("double[] normals = [1, 2, 3, 4]", False, "normals is left out"),
    ],
)
def test_normals_of_any_interpolation_and_type(tmp_path: Path, normals: str, tilted: bool, said: str) -> None:
    path = _stage(tmp_path, f'def Mesh "M"\n{{\n uniform token subdivisionScheme = "none"\n{_QUAD} {normals}\n}}\n')
    converted = convert(path, tmp_path / "a.glb")
    expected = [0.6, 0, 0.8] if tilted else [0, 0, 1]
    np.testing.assert_allclose(Glb(tmp_path / "a.glb").values("NORMAL"), [expected] * 4, atol=1e-6)
    assert len(converted.messages) == bool(said) and all(said in message for message in converted.messages)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (_MESH.replace(_POINTS, "int points = 1"), "/M: its faces use points that it does not have"),
        (_MESH.replace("int[] faceVertexCounts = [4]", 'string faceVertexCounts = "a"'), "/M is left out"),
        (
            f'def Mesh "M"\n{{\n{_QUAD}'
            " matrix4d xformOp:transform = ((1, 0, 0, 0.5), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))\n"
            ' uniform token[] xformOpOrder = ["xformOp:transform"]\n}\n',
            "/M is left out: its matrix is a projection",
        ),
        ('def Points "P"\n{\n}\n', "/P is left out: Points is not read: export it as a mesh"),
    ],
)
def test_a_body_that_cannot_be_read_is_left_out_in_a_line(tmp_path: Path, body: str, said: str) -> None:
    path = _stage(tmp_path, body)
    with pytest.raises(UsdError) as error:
        convert(path, tmp_path / "a.glb")
    assert str(error.value).startswith(f"{path}: there is no mesh in it that can be shown: ")
    assert said in str(error.value)
    assert "\n" not in str(error.value)
    both = tmp_path / "both.usda"
    both.write_text(path.read_text() + _MESH.replace('"M"', '"Good"'))
    assert any(said in message for message in convert(both, tmp_path / "a.glb").messages)


def test_a_unit_of_single_precision(tmp_path: Path) -> None:
    from pxr import Sdf, Usd

    path = tmp_path / "a.usdc"
    source = _stage(tmp_path, _MESH)
    layer = Sdf.Layer.FindOrOpen(str(source))
    layer.pseudoRoot.SetInfo("metersPerUnit", 0.25)
    layer.Export(str(path))
    # Crate files keep 0.25 in place, as a float with the type of a double (9): 8 is that of a float.
    double, single = (struct.pack("<Q", 1 << 62 | kind << 48 | 0x3E800000) for kind in (9, 8))
    data = path.read_bytes()
    assert data.count(double) == 1
    path.write_bytes(data.replace(double, single))
    with pytest.raises(Exception, match="Requested type double"):
        from pxr import UsdGeom

        UsdGeom.GetStageMetersPerUnit(Usd.Stage.Open(str(path)))
    scene = kuafu.Scene(kuafu.Device("cpu"))
    load_usd(scene, path)
    np.testing.assert_allclose(scene.summary.bounds_max_m, [0.25, 0.25, 0], atol=1e-7)


@pytest.mark.parametrize(
    ("solid", "low", "high"),
    [
        ('Cylinder "S"\n{\n double radius = 0.5\n double height = 3', [-0.5, -0.5, -1.5], [0.5, 0.5, 1.5]),
        ('Cone "S"\n{\n double radius = 1\n double height = 2\n uniform token axis = "X"', [-1, -1, -1], [1, 1, 1]),
        ('Capsule "S"\n{\n double radius = 0.5\n double height = 1\n uniform token axis = "Y"', [-0.5, -1, -0.5],
         [0.5, 1, 0.5]),
    ],
)  # fmt: skip
def test_turned_solids(tmp_path: Path, solid: str, low: list[float], high: list[float]) -> None:
    scene = kuafu.Scene(kuafu.Device("cpu"))
    assert not load_usd(scene, _stage(tmp_path, f"def {solid}\n}}\n")).messages
    np.testing.assert_allclose(scene.summary.bounds_min_m, low, atol=2e-3)
    np.testing.assert_allclose(scene.summary.bounds_max_m, high, atol=2e-3)


_ARROW = [(0, 0), (4, 1), (0, 2), (1, 1)]
_COMB = [(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (4, 1), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)]
_SLIT = [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)]  # a hole by a bridge


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("outline", [_ARROW, _COMB, _SLIT], ids=["arrow", "comb", "hole"])
def test_a_concave_face_is_covered_once(
    tmp_path: Path, outline: list[tuple[float, float]], orientation: str, turn: int
) -> None:
    """Each triangle faces as the polygon does, and their areas sum up to its own (the shoelace formula)."""
    corners = np.roll(np.array(outline, float), -turn, axis=0)
    text = ", ".join(f"({x}, {y}, 1)" for x, y in corners)
    numbers = ", ".join(map(str, range(len(corners))))
    path = _stage(
        tmp_path,
        f'def Mesh "M"\n{{\n uniform token subdivisionScheme = "none"\n uniform token orientation = "{orientation}"\n'
        f" int[] faceVertexCounts = [{len(corners)}]\n int[] faceVertexIndices = [{numbers}]\n"
        f" point3f[] points = [{text}]\n}}\n",
    )
    convert(path, tmp_path / "a.glb")
    points, indices = (Glb(tmp_path / "a.glb").values(name) for name in ("POSITION", "indices"))
    a, b, c = (points[indices.reshape(-1, 3)[:, k], :2].astype(float) for k in range(3))
    twice = np.cross(b - a, c - a) * (1 if orientation == "rightHanded" else -1)
    (x, y), (next_x, next_y) = corners.T, np.roll(corners, -1, axis=0).T
    assert twice.min() > 0 and len(twice) == len(corners) - 2
    assert twice.sum() == pytest.approx((x * next_y - next_x * y).sum())


_SHEET = """
def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    uniform token subdivisionScheme = "none"
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    texCoord2f[] primvars:map1 = [(0.25, 0.5), (1, 0), (1, 1)] (interpolation = "vertex")
    {more}
    {binding}
}}
"""

_MATERIAL = """
def Material "{name}"
{{
    {inputs}
    token outputs:surface.connect = </{name}/S.outputs:surface>
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        {surface}
        token outputs:surface
    }}
    {shaders}
}}
"""


_OUTPUTS = "float3 outputs:rgb\nfloat outputs:r\nfloat outputs:g\n"
_READER = 'uniform token info:id = "UsdPrimvarReader_float2"\nfloat2 outputs:result\nstring inputs:varname'


def _material(name: str, surface: str, inputs: str = "", **shaders: str) -> str:
    made = [f'def Shader "{key}"\n{{\n{body}\n}}\n' for key, body in shaders.items()]
    return _MATERIAL.format(name=name, surface=surface, inputs=inputs, shaders="".join(made))


def _texture(file: str, more: str = "") -> str:
    return f'uniform token info:id = "UsdUVTexture"\nasset inputs:file = @{file}@\n{more}\n{_OUTPUTS}'


def _sheet(name: str, material: str | None, more: str = "") -> str:
    binding = f"rel material:binding = </{material}>" if material else ""
    return _SHEET.format(name=name, binding=binding, more=more)


class _Made(Glb):
    """A converted stage."""

    def __init__(self, folder: Path, text: str) -> None:
        self.messages = convert(_stage(folder, text), folder / "a.glb").messages
        super().__init__(folder / "a.glb")

    def told(self, words: str) -> bool:
        return any(words in message for message in self.messages)


def _color(path: Path, color: Any, mode: str = "RGB") -> None:
    path.parent.mkdir(exist_ok=True)
    Image.new(mode, (2, 2), color).save(path)


def test_inputs_are_followed_to_the_materials_own(tmp_path: Path) -> None:
    _color(tmp_path / "paint.png", (9, 8, 7))
    paint = _material(
        "Paint",
        "color3f inputs:diffuseColor.connect = </Paint/T.outputs:rgb>\n"
        "float inputs:metallic.connect = </Paint.inputs:m>",
        'asset inputs:picture = @paint.png@\nstring inputs:uv = "map1"\nfloat inputs:m = 0.75',
        T='uniform token info:id = "UsdUVTexture"\nasset inputs:file.connect = </Paint.inputs:picture>\n'
        "float2 inputs:st.connect = </Paint/Turn.outputs:result>\n" + _OUTPUTS,
        Turn='uniform token info:id = "UsdTransform2d"\nfloat2 outputs:result\n'
        "float2 inputs:in.connect = </Paint/Reader.outputs:result>",
        Reader=_READER + ".connect = </Paint.inputs:uv>",
    )
    made = _Made(tmp_path, _sheet("A", "Paint") + paint)
    assert made.pixel("/Paint", "baseColorTexture") == (9, 8, 7)
    assert made.material["/Paint"]["pbrMetallicRoughness"]["metallicFactor"] == 0.75
    assert [0.25, 0.5] in made.values("TEXCOORD_0").tolist()
    assert made.told("a transform of its coordinates")


def test_a_subset_has_its_own_materials_coordinates(tmp_path: Path) -> None:
    _color(tmp_path / "paint.png", (9, 8, 7))
    subset = (
        'def GeomSubset "All" (prepend apiSchemas = ["MaterialBindingAPI"])\n{\n'
        'uniform token familyName = "materialBind"\nuniform token elementType = "face"\n'
        "int[] indices = [0]\nrel material:binding = </Paint>\n}\n"
    )
    paint = _material(
        "Paint",
        "color3f inputs:diffuseColor.connect = </Paint/T.outputs:rgb>\n"
        "normal3f inputs:normal.connect = </Paint/N.outputs:rgb>",
        T=_texture("paint.png", "float2 inputs:st.connect = </Paint/Reader.outputs:result>"),
        N=_texture("paint.png"),
        Reader=_READER + ' = "map1"',
    )
    made = _Made(tmp_path, _sheet("A", None, subset) + paint)
    assert [0.25, 0.5] in made.values("TEXCOORD_0").tolist()
    assert made.told("its textures lie by map1; st are not read")


def test_pictures_are_told_apart_by_folder_and_role(tmp_path: Path) -> None:
    for folder, red in (("x", 10), ("y", 20)):
        _color(tmp_path / folder / "albedo.png", (red, 30, 40))
        layer = _material("P", "color3f inputs:diffuseColor.connect = </P/T.outputs:rgb>", T=_texture("./albedo.png"))
        (tmp_path / folder / "p.usda").write_text('#usda 1.0\n(\n defaultPrim = "P"\n)\n' + layer)
    text = ""
    for name in "XY":
        text += f'def "{name}" (references = @./{name.lower()}/p.usda@)\n{{\n}}\n' + _sheet(f"On{name}", name)
    for key in ("roughness", "metallic"):
        surface = f"float inputs:{key}.connect = </{key}/T.outputs:g>"
        text += _sheet(f"With_{key}", key) + _material(key, surface, T=_texture("x/albedo.png"))
    made = _Made(tmp_path, text)
    assert [made.pixel(name, "baseColorTexture")[0] for name in ("/X", "/Y")] == [10, 20]
    packed = [made.pixel(name, "metallicRoughnessTexture") for name in ("/roughness", "/metallic")]
    assert packed == [(255, 30, 255), (255, 255, 30)]


def test_what_is_not_read_of_textures_is_told(tmp_path: Path) -> None:
    _color(tmp_path / "paint.png", (9, 8, 7))
    keys = ("clearcoat", "clearcoatRoughness", "ior", "opacityThreshold", "occlusion")
    text = _material(
        "Paint",
        "".join(f"float inputs:{key}.connect = </Paint/T.outputs:r>\n" for key in keys[:1] + keys[2:])
        + "color3f inputs:diffuseColor.connect = </Paint/Raw.outputs:rgb>\n"
        + "float inputs:roughness.connect = </Paint/Missing.outputs:g>",
        T=_texture("paint.png"),
        Raw=_texture("paint.png", 'token inputs:sourceColorSpace = "raw"'),
        Missing=_texture("none.png", "float4 inputs:fallback = (0.5, 0.125, 0, 1)"),
    )
    text += _material(
        "Coat",
        "float inputs:clearcoat = 1\nfloat inputs:clearcoatRoughness.connect = </Coat/T.outputs:r>",
        T=_texture("paint.png"),
    )
    made = _Made(tmp_path, _sheet("A", "Paint") + _sheet("B", "Coat") + text)
    for key in keys:
        assert made.told(f"{key}: its texture is not read" if key != "occlusion" else "occlusion is not read"), key
    assert made.told("sourceColorSpace")
    assert made.told("none.png is not there")
    assert made.material["/Paint"]["pbrMetallicRoughness"]["roughnessFactor"] == 0.125


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_a_cut_picture_is_told(tmp_path: Path, suffix: str) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (32, 32, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / f"p.{suffix}")
    data = (tmp_path / f"p.{suffix}").read_bytes()
    (tmp_path / f"p.{suffix}").write_bytes(data[: len(data) // 2])
    paint = _material("Paint", "float inputs:roughness.connect = </Paint/T.outputs:r>", T=_texture(f"p.{suffix}"))
    assert _Made(tmp_path, _sheet("A", "Paint") + paint).told("no image that can be read")


def test_sixteen_bits_of_grey_keep_their_level(tmp_path: Path) -> None:
    Image.fromarray(np.full((2, 2), 0x4080, np.uint16)).save(tmp_path / "p.png")
    paint = _material("Paint", "float inputs:roughness.connect = </Paint/T.outputs:r>", T=_texture("p.png"))
    made = _Made(tmp_path, _sheet("A", "Paint") + paint)
    assert made.pixel("/Paint", "metallicRoughnessTexture") == (255, 0x40, 255)


def test_a_colours_own_alpha_is_no_opacity(tmp_path: Path) -> None:
    _color(tmp_path / "p.png", (9, 8, 7, 60), "RGBA")
    surface = "color3f inputs:diffuseColor.connect = </Paint/T.outputs:rgb>\nfloat inputs:opacity = 0.5"
    made = _Made(tmp_path, _sheet("A", "Paint") + _material("Paint", surface, T=_texture("p.png")))
    assert made.pixel("/Paint", "baseColorTexture") == (9, 8, 7)
    assert made.material["/Paint"]["pbrMetallicRoughness"]["baseColorFactor"] == [1.0, 1.0, 1.0, 0.5]


def test_foreign_materials_show_each_prims_own_colour(tmp_path: Path) -> None:
    text = 'def Material "Other"\n{\n}\n'
    for name, color in (("A", "1, 0, 0"), ("B", "0, 1, 0")):
        text += _sheet(name, "Other", f"color3f[] primvars:displayColor.timeSamples = {{ 1: [({color})] }}")
    made = _Made(tmp_path, text)
    colors = [m["pbrMetallicRoughness"]["baseColorFactor"][:3] for m in made.document["materials"]]
    assert colors == [[1, 0, 0], [0, 1, 0]]
    assert made.told("only UsdPreviewSurface")


def test_holes_are_not_shown(tmp_path: Path) -> None:
    mesh = (
        'def Mesh "M"\n{\n point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]\n'
        " int[] faceVertexCounts = [3, 3]\n int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]\n int[] holeIndices = [1]\n}\n"
    )
    document = _Made(tmp_path, mesh).document
    assert document["accessors"][document["meshes"][0]["primitives"][0]["indices"]]["count"] == 3


# Without time, transforms that have samples alone are those of their first sample, like all else.
def test_sampled_places_without_time(tmp_path: Path) -> None:
    move = (
        "double3 xformOp:translate.timeSamples = { 1: (5, 0, 0), 2: (9, 0, 0) }\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]'
    )
    copies = (
        'def PointInstancer "Copies"\n{\n point3f[] positions.timeSamples = { 1: [(0, 3, 0)] }\n'
        " int[] protoIndices = [0]\n rel prototypes = </Copies/Block>\n"
        ' def Cube "Block"\n {\n }\n}\n'
    )
    made = _Made(tmp_path, _sheet("A", None, move) + copies)
    places = {node["name"]: node["matrix"][12:15] for node in made.document["nodes"]}
    assert places == {"/A": [5, 0, 0], "/Copies/Block": [0, 3, 0]}


def test_copies_that_cannot_be_placed_are_told(tmp_path: Path) -> None:
    copies = (
        'def PointInstancer "Copies"\n{\n point3f[] positions = [(0, 3, 0), (0, 9, 0)]\n'
        " int[] protoIndices = [0, 7]\n rel prototypes = </Copies/Block>\n"
        ' def Cube "Block"\n {\n }\n}\n'
    )
    assert _Made(tmp_path, _sheet("A", None) + copies).told("/Copies: its copies cannot be placed")
