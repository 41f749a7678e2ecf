# SPDX-License-Identifier: Apache-2.0
"""USD as exporters write it beside the schemas: each is read, or left out in a line."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

import kuafu
from activestereo.scene_io.usd import UsdError, convert, load_usd

pytest.importorskip("pxr", reason="the package usd-core is not installed (pip install usd-core)")

_POINTS = "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]"
_QUAD = f" int[] faceVertexCounts = [4]\n int[] faceVertexIndices = [0, 1, 2, 3]\n {_POINTS}\n"
_MESH = f'def Mesh "M"\n{{\n{_QUAD}}}\n'


def _stage(folder: Path, body: str) -> Path:
    path = folder / "a.usda"
    path.write_text('#usda 1.0\n(\n metersPerUnit = 1\n upAxis = "Y"\n)\n' + body)
    return path


def _accessor(glb: Path, name: str) -> np.ndarray:
    """The first mesh's indices, or [n, 3] of an attribute."""
    data = glb.read_bytes()
    size = struct.unpack("<I", data[12:16])[0]
    document = json.loads(data[20 : 20 + size])
    primitive = document["meshes"][0]["primitives"][0]
    accessor = document["accessors"][primitive[name] if name == "indices" else primitive["attributes"][name]]
    at = 28 + size + document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    if name == "indices":
        return np.frombuffer(data, "<u4", accessor["count"], at)
    return np.frombuffer(data, "<f4", 3 * accessor["count"], at).reshape(-1, 3)


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
    np.testing.assert_allclose(_accessor(tmp_path / "a.glb", "NORMAL"), [expected] * 4, atol=1e-6)
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
    assert str(error.value).startswith(f"{path}: there is no mesh in it that can be shown: ") and said in str(
        error.value
    )
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
        (
            'Capsule "S"\n{\n double radius = 0.5\n double height = 1\n uniform token axis = "Y"',
            [-0.5, -1, -0.5],
            [0.5, 1, 0.5],
        ),
    ],
)
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
    points, indices = (_accessor(tmp_path / "a.glb", name) for name in ("POSITION", "indices"))
    a, b, c = (points[indices.reshape(-1, 3)[:, k], :2].astype(float) for k in range(3))
    twice = np.cross(b - a, c - a) * (1 if orientation == "rightHanded" else -1)
    (x, y), (next_x, next_y) = corners.T, np.roll(corners, -1, axis=0).T
    assert twice.min() > 0 and len(twice) == len(corners) - 2
    assert twice.sum() == pytest.approx((x * next_y - next_x * y).sum())
