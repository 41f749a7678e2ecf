# SPDX-License-Identifier: Apache-2.0
"""Opens a stage with usd-core, and converts its meshes to triangles, one Mesh for each set of faces with one material.
Concave polygons are cut ear by ear (Meisters, Polygons have ears, 1975)."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.optional import imported
from activestereo.scene_io import meshes
from activestereo.scene_io.meshes import Mesh

_LOG = logging.getLogger("activestereo.scene_io.usd")


class UsdError(ValueError):
    """Raised if a USD file cannot be converted. The message has the file and the remedy."""


@dataclass
class Stage:
    """An open USD stage, read at one time code, with the messages about its conversion."""

    path: Path
    stage: Any  # Usd.Stage
    time: Any  # Usd.TimeCode
    messages: list[str] = field(default_factory=list)

    def tell(self, message: str) -> None:
        """Logs and keeps a message, unless it was given before."""
        if message not in self.messages:
            self.messages.append(message)
            _LOG.warning("%s: %s", self.path, message)

    def value(self, attribute: Any, fallback: Any = None) -> Any:
        """Returns an attribute's value at the stage's time, or `fallback` if it has none."""
        value = attribute.Get(self.time) if attribute else None
        return fallback if value is None else value

    def vectors(self, attribute: Any, size: int = 3) -> np.ndarray:
        """Returns an attribute's vectors [n, size]; [0, size] without a value. A value of another kind also gives [0,
        size], with a message."""
        value = self.value(attribute)
        if value is None:
            return np.empty((0, size))
        try:
            out = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            out = np.empty(0)
        if out.shape != (len(out) if out.ndim else 0, size):
            self.tell(f"{attribute.GetPath()} is left out: it is no array of vectors of {size} numbers")
            return np.empty((0, size))
        return out

    def to_metres(self) -> np.ndarray:
        """Returns the 4x4 from the stage's axes and unit to metres with y up."""
        from pxr import UsdGeom

        # UsdGeom.GetStageMetersPerUnit takes doubles alone, and some exporters write a float.
        authored = self.stage.GetPseudoRoot().GetMetadata(UsdGeom.Tokens.metersPerUnit)
        scale = float(UsdGeom.LinearUnits.centimeters if authored is None else authored)
        out = np.diag([scale, scale, scale, 1.0])
        if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z:
            out = out @ np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
        return out


def open_stage(path: Path, time_s: float | None) -> Stage:
    """Opens a stage at a time: seconds after its start, or None for each attribute's earliest sample. Raises
    UsdError."""
    missing = f"{path}: USD is read by the package usd-core, which is missing: pip install usd-core, or export glTF"
    Tf, Usd = (imported(name, missing, UsdError) for name in ("pxr.Tf", "pxr.Usd"))
    if not path.is_file():
        raise UsdError(f"{path}: there is no such file")
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise UsdError(f"{path}: is no USD file that can be read: {cause(error)}") from error
    # EarliestTime also reads attributes without samples. Usd.TimeCode.Default would miss those with samples only.
    if time_s is None:
        return Stage(path, stage, Usd.TimeCode.EarliestTime())
    return Stage(path, stage, Usd.TimeCode(stage.GetStartTimeCode() + time_s * stage.GetTimeCodesPerSecond()))


def cause(error: Exception) -> str:
    """Returns the first text that an error of Pixar's USD quotes; such errors begin with source lines of USD."""
    quoted = [line.split(" : '", 1)[1].rstrip("'") for line in str(error).splitlines() if " : '" in line]
    return quoted[0] if quoted else "its errors say nothing"


def columns(matrix: Any) -> np.ndarray:
    """Converts a Gf.Matrix4d, which multiplies row vectors, to a 4x4 that multiplies column vectors."""
    return np.array(matrix, dtype=float).T


Points = NDArray[np.float64]

_MOST_CORNERS = 2000  # cutting ears takes quadratic time; polygons with more corners stay fans


def _ears(places: Points) -> NDArray[np.int64]:
    """Cuts a polygon [n, 3] into triangles [n - 2, 3] of corner numbers, with the polygon's winding."""
    normal = np.cross(places - places[0], np.roll(places, -1, axis=0) - places[0]).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    flat = places[:, [(axis + 1) % 3, (axis + 2) % 3]]
    if normal[axis] < 0:
        flat = flat[:, ::-1]
    rest, out = list(range(len(flat))), []

    def turn(a: Points, b: Points, c: Points) -> Points:
        """Computes twice the triangles' signed area; positive for a left turn."""
        return np.asarray((b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0]))

    def is_ear(k: int) -> bool:
        triangle = [rest[k - 1], rest[k], rest[(k + 1) % len(rest)]]
        a, b, c = flat[triangle]
        if turn(a, b, c) <= 0:
            return False
        others = flat[[i for i in rest if i not in triangle]]
        inside = np.all([turn(p, q, others) >= 0 for p, q in ((a, b), (b, c), (c, a))], axis=0)
        corner = np.any([(others == p).all(axis=1) for p in (a, b, c)], axis=0)  # a hole's bridge comes back to it
        return not bool((inside & ~corner).any())

    while len(rest) > 3:
        ear = next((k for k in range(len(rest)) if is_ear(k)), 0)  # 0: its sides cross each other
        out.append([rest[ear - 1], rest[ear], rest[(ear + 1) % len(rest)]])
        del rest[ear]
    return np.array([*out, rest])


@dataclass(frozen=True)
class Polygons:
    """A USD mesh's faces, cut into t triangles. A face corner is a vertex of one face, numbered over all faces.
    corners: [t, 3], face corners of the triangles. vertices: the mesh's point at each face corner."""

    corners: np.ndarray
    faces: np.ndarray  # [t], the face that each triangle is of
    vertices: np.ndarray  # [corner count]
    corner_face: np.ndarray  # [corner count]
    face_count: int
    point_count: int


def _cut_concave(cut: Polygons, points: np.ndarray) -> Polygons:
    """Replaces the triangle fans of concave faces by ear clipping. Other faces keep their fans. points: [n, 3], the
    mesh's."""
    count, face = np.bincount(cut.corner_face, minlength=cut.face_count), cut.corner_face
    first, corners, places = np.cumsum(count) - count, cut.corners.copy(), points[cut.vertices]
    # 1. Faces with a corner that turns against the face's normal are concave.
    step = np.arange(len(face)) - first[face]
    after, before = (first[face] + (step + turn) % count[face] for turn in (1, -1))
    normal = np.zeros((len(count), 3))
    np.add.at(normal, face, np.cross(places - places[first[face]], places[after] - places[first[face]]))
    turn = np.cross(places - places[before], places[after] - places)
    size = np.linalg.norm(turn, axis=1) * np.linalg.norm(normal[face], axis=1)
    inward = np.einsum("ij,ij->i", turn, normal[face]) < -1e-6 * size
    concave = np.unique(face[inward & (count[face] > 3) & (count[face] <= _MOST_CORNERS)])
    # 2. Cut them.
    for number in concave:
        begin, end = np.searchsorted(cut.faces, [number, number + 1])
        if begin == end:  # a hole
            continue
        own = first[number] + _ears(places[first[number] : first[number] + count[number]])
        left_handed = corners[begin, 1] > corners[begin, 2]
        corners[begin:end] = own[:, [0, 2, 1]] if left_handed else own
    return replace(cut, corners=corners)


def _at_corners(values: np.ndarray, interpolation: str, cut: Polygons) -> np.ndarray | None:
    """Returns the values of a USD primvar at each face corner, [corners, k]. values: [n, k]; interpolation: USD's name,
    such as 'vertex'. Returns None if n does not fit the interpolation."""
    count, index = {
        "vertex": (cut.point_count, cut.vertices),
        "varying": (cut.point_count, cut.vertices),
        "uniform": (cut.face_count, cut.corner_face),
        "constant": (len(values), np.zeros(len(cut.vertices), dtype=np.int64)),
        "faceVarying": (len(cut.vertices), np.arange(len(cut.vertices))),
    }.get(interpolation, (0, None))
    if index is None or len(values) != count or not count:
        return None
    return np.asarray(values, dtype=np.float64)[index]


def _primvar(stage: Stage, prim: Any, name: str, cut: Polygons) -> np.ndarray | None:
    from pxr import UsdGeom

    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    values = np.asarray(primvar.ComputeFlattened(stage.time), dtype=np.float64)
    if values.ndim == 0:
        return None
    return _at_corners(values.reshape(len(values), -1), str(primvar.GetInterpolation()), cut)


def _normals(stage: Stage, mesh: Any, cut: Polygons, points: np.ndarray) -> np.ndarray:
    """Returns unit normals of the corners of `cut`, [corners, 3], in the mesh's own frame. Without usable normals in
    the file, a mesh with a subdivision scheme gets smooth normals and another mesh its faces' normals."""
    found = _primvar(stage, mesh.GetPrim(), "normals", cut)
    if found is None:
        authored = stage.vectors(mesh.GetNormalsAttr())
        found = _at_corners(authored, str(mesh.GetNormalsInterpolation()), cut)
        if found is None and len(authored):
            kind = str(mesh.GetNormalsInterpolation())
            stage.tell(f"{mesh.GetPath()}: its {len(authored)} normals are left out: that is no {kind} count of it")
    if found is None:
        edges = points[cut.vertices[cut.corners]]
        area = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
        smooth = stage.value(mesh.GetSubdivisionSchemeAttr()) != "none"
        owner, count = (cut.vertices, len(points)) if smooth else (cut.corner_face, int(cut.corner_face.max()) + 1)
        total = np.zeros((count, 3))
        np.add.at(total, owner[cut.corners].ravel(), np.repeat(area, 3, axis=0))
        found = total[owner]
    length = np.linalg.norm(found, axis=1, keepdims=True)
    return np.where(length > 0, found / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])


def triangles_of(stage: Stage, mesh: Any) -> tuple[Polygons, Mesh] | None:
    """Returns a USD mesh as (Polygons, Mesh), None if it is empty or invalid. The Mesh has a vertex for each face
    corner, normals, and texture coordinates of 0."""
    # 1. Each face is a fan of triangles; a hole has none.
    points = stage.vectors(mesh.GetPointsAttr())
    counts = np.asarray(stage.value(mesh.GetFaceVertexCountsAttr(), []), dtype=np.int64)
    vertices = np.asarray(stage.value(mesh.GetFaceVertexIndicesAttr(), []), dtype=np.int64)
    if not len(counts) or counts.sum() != len(vertices):
        return None
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    triangles = np.maximum(counts - 2, 0)
    if stage.value(mesh.GetSubdivisionSchemeAttr()) != "none":
        holes = np.asarray(stage.value(mesh.GetHoleIndicesAttr(), []), dtype=np.int64)
        triangles[holes[(holes >= 0) & (holes < len(counts))]] = 0
    faces = np.repeat(np.arange(len(counts)), triangles)
    step = np.arange(len(faces)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    corners = np.stack([first[faces], first[faces] + step + 1, first[faces] + step + 2], axis=1)
    if stage.value(mesh.GetOrientationAttr()) == "leftHanded":
        corners = corners[:, [0, 2, 1]]
    if not len(corners):
        return None
    cut = Polygons(corners, faces, vertices, np.repeat(np.arange(len(counts)), counts), len(counts), len(points))
    # 2. Concave faces, and the vertices' normals.
    if not len(points) or cut.vertices.min() < 0 or cut.vertices.max() >= len(points):
        stage.tell(f"{mesh.GetPath()}: its faces use points that it does not have; it is left out")
        return None
    if stage.value(mesh.GetSubdivisionSchemeAttr()) != "none":
        stage.tell("meshes are shown as their control cages, with smooth normals: subdivision surfaces are not read")
    cut = _cut_concave(cut, points)
    uvs = np.zeros((len(cut.vertices), 2))
    return cut, Mesh.from_arrays(points[cut.vertices], _normals(stage, mesh, cut, points), uvs, cut.corners)


def textured(stage: Stage, mesh: Any, cut: Polygons, whole: Mesh, uv_name: str) -> Mesh:
    """Returns the Mesh of triangles_of() with texture coordinates from the primvar `uv_name`; unchanged if there is
    none."""
    uvs = _primvar(stage, mesh.GetPrim(), uv_name, cut)
    if uvs is None:
        return whole
    return replace(whole, uvs=(uvs[:, :2] * [1, -1] + [0, 1]).astype(np.float32))  # v down


def part(whole: Mesh, triangles: np.ndarray) -> Mesh:
    """Returns a Mesh of the chosen triangles alone, with equal vertices joined. triangles: mask or numbers."""
    rows = np.hstack([whole.positions, whole.normals, whole.uvs])[whole.indices[triangles].ravel()]
    unique, index = np.unique(rows, axis=0, return_inverse=True)
    return Mesh.from_arrays(unique[:, :3], unique[:, 3:6], unique[:, 6:], index.reshape(-1, 3))


def solid(stage: Stage, prim: Any) -> Mesh | None:
    """Returns the mesh of a Cube, Sphere, Plane, Cylinder, Cone or Capsule; None for another prim."""
    from pxr import UsdGeom

    if prim.IsA(UsdGeom.Cube):
        size = float(stage.value(UsdGeom.Cube(prim).GetSizeAttr(), 2.0))
        box = meshes.box(size, size, size)
        return replace(box, positions=box.positions - np.array([0, size / 2, 0], np.float32))
    if prim.IsA(UsdGeom.Sphere):
        return meshes.sphere(float(stage.value(UsdGeom.Sphere(prim).GetRadiusAttr(), 1.0)))
    if prim.IsA(UsdGeom.Plane):
        plane = UsdGeom.Plane(prim)
        width, length = (float(stage.value(a, 2.0)) for a in (plane.GetWidthAttr(), plane.GetLengthAttr()))
        u, v = {"X": ([0, 0, -width], [0, length, 0]), "Y": ([width, 0, 0], [0, 0, -length])}.get(
            str(stage.value(plane.GetAxisAttr(), "Z")), ([width, 0, 0], [0, length, 0])
        )
        return meshes.sheet(-(np.array(u) + v) / 2, u, v)
    kind = next((kind for kind in (UsdGeom.Cylinder, UsdGeom.Cone, UsdGeom.Capsule) if prim.IsA(kind)), None)
    if kind is None:
        return None
    turned = kind(prim)
    radius, height = (float(stage.value(a)) for a in (turned.GetRadiusAttr(), turned.GetHeightAttr()))
    bottom, top = (0, -height / 2), (0, height / 2)
    if kind is UsdGeom.Capsule:
        line = np.vstack([meshes.arc(bottom, radius, -90, 0), meshes.arc(top, radius, 0, 90)])
        line[[0, -1], 0] = 0.0
        mesh = meshes.lathe([line])
    else:
        low, high = (radius, bottom[1]), (radius, top[1])
        sides = [[low, top]] if kind is UsdGeom.Cone else [[low, high], [high, top]]
        mesh = meshes.lathe([[bottom, low], *sides])
    # A lathe turns about y.
    axes = {"X": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "Z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]]}
    turn = np.transpose(axes.get(str(stage.value(turned.GetAxisAttr(), "Z")), np.eye(3)))
    return Mesh.from_arrays(mesh.positions @ turn, mesh.normals @ turn, mesh.uvs, mesh.indices)
