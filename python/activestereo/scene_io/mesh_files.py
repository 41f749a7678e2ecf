# SPDX-License-Identifier: Apache-2.0
"""Meshes of CAD programs: .stl (binary and text), .obj and .ply (binary and text) as triangles with normals.

Normals follow the faces around a vertex that turn by less than CREASE_DEG from one another, so that a cylinder's side
is round and its rim sharp. Kuafu reads more formats; these are what a scene is put together from.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

from activestereo.common.input_files import read_bytes
from activestereo.scene_io.meshes import Mesh

CREASE_DEG = 40.0
SUFFIXES = (".stl", ".obj", ".ply")
LARGEST_M = 5.0

Points = NDArray[np.float64]
Faces = NDArray[np.int64]


def read_mesh(path: str | Path, unit_m: float = 1.0) -> Mesh:
    """The mesh of a file in metres; unit_m: metres per unit of the file, CAD often has 0.001. ValueError names the file
    and what is wrong."""
    path = Path(path)
    readers = {".stl": _stl, ".obj": _obj, ".ply": _ply}
    if path.suffix.lower() not in readers:
        raise ValueError(f"{path}: is not {', '.join(SUFFIXES)}: export the part as one of these")
    try:
        points, faces = readers[path.suffix.lower()](read_bytes(path))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, IndexError, KeyError, OverflowError) as error:
        raise ValueError(f"{path}: cannot be read as {path.suffix}: {error}") from error
    if not len(faces) or not np.isfinite(points).all() or faces.min() < 0 or faces.max() >= len(points):
        raise ValueError(f"{path}: holds {len(faces)} triangles and {len(points)} points that make no mesh")
    points = points * unit_m
    size_m = float(np.ptp(points[faces.ravel()], axis=0).max())
    if not 0.0 < size_m <= LARGEST_M:
        raise ValueError(f"{path}: the part is {size_m:g} m long: say the file's unit, such as 0.001 for millimetres")
    return shaded(points, faces)


def shaded(points: Points, faces: Faces) -> Mesh:
    """A Mesh with normals by creases. points [n][3], faces [t][3]."""
    points, same = np.unique(points, axis=0, return_inverse=True)
    faces = same.reshape(-1)[faces]
    edges = points[faces]
    area = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    kept = np.linalg.norm(area, axis=1) > 1e-14
    faces, area = faces[kept], area[kept]
    unit = area / np.linalg.norm(area, axis=1, keepdims=True)
    corners, count = faces.ravel(), len(faces)
    ones = np.ones(len(corners))
    corner_vertex = coo_matrix((ones, (np.arange(len(corners)), corners)), (len(corners), len(points))).tocsr()
    vertex_face = coo_matrix((ones, (corners, np.repeat(np.arange(count), 3))), (len(points), count)).tocsr()
    pairs = (corner_vertex @ vertex_face).tocoo()
    alike = np.einsum("ij,ij->i", unit[pairs.row // 3], unit[pairs.col]) > np.cos(np.deg2rad(CREASE_DEG))
    near = coo_matrix((np.ones(alike.sum()), (pairs.row[alike], pairs.col[alike])), (len(corners), count)).tocsr()
    normals = near @ area
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh.of(points[corners], normals, np.zeros((len(corners), 2)), np.arange(len(corners)).reshape(-1, 3))


def _stl(data: bytes) -> tuple[Points, Faces]:
    count = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 and len(data) == 84 + 50 * count:
        record = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])
        points = np.frombuffer(data, record, count, 84)["points"].reshape(-1, 3).astype(np.float64)
    else:
        rows = [line.split()[1:4] for line in data.decode("ascii", "replace").splitlines() if "vertex" in line]
        points = np.array(rows, dtype=np.float64).reshape(-1, 3)
    if len(points) % 3:
        raise ValueError(f"{len(points)} corners are no whole number of triangles")
    return points, np.arange(len(points)).reshape(-1, 3)


def _obj(data: bytes) -> tuple[Points, Faces]:
    points, faces = [], []
    for line in data.decode("utf-8", "replace").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            numbers = [int(word.split("/")[0]) for word in words[1:]]
            polygon = [n - 1 if n > 0 else len(points) + n for n in numbers]
            faces += [[polygon[0], a, b] for a, b in zip(polygon[1:], polygon[2:], strict=False)]
    return np.array(points, dtype=np.float64).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)


_PLY_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}


def _ply(data: bytes) -> tuple[Points, Faces]:
    """Vertices first, then faces, as every program writes them (Turk, The PLY polygon file format, 1994)."""
    end = data.index(b"end_header")
    end = data.index(b"\n", end) + 1
    lines = [line.split() for line in data[:end].decode("ascii", "replace").splitlines()]
    kind = next(line[1] for line in lines if line[:1] == ["format"])
    elements: dict[str, tuple[int, list[list[str]]]] = {}
    for line in lines:
        if line[:1] == ["element"]:
            elements[line[1]] = int(line[2]), []
        elif line[:1] == ["property"]:
            elements[list(elements)[-1]][1].append(line[1:])
    if kind == "ascii":
        return _ply_text(data[end:].decode("ascii", "replace").splitlines(), elements)
    order = "<" if "little" in kind else ">"
    count, columns = elements["vertex"]
    record = np.dtype([(name, order + _PLY_TYPES[word]) for word, name in columns])
    table = np.frombuffer(data, record, count, end)
    points = np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1)
    face_count, face_columns = elements["face"]
    faces, at = [], end + count * record.itemsize
    for _ in range(face_count):
        polygon: list[int] = []
        for column in face_columns:
            if column[0] != "list":
                at += np.dtype(_PLY_TYPES[column[0]]).itemsize
                continue
            sizes, items = (np.dtype(order + _PLY_TYPES[word]) for word in column[1:3])
            length = int(np.frombuffer(data, sizes, 1, at)[0])
            values = np.frombuffer(data, items, length, at + sizes.itemsize)
            at += sizes.itemsize + length * items.itemsize
            if "ind" in column[3]:
                polygon = [int(value) for value in values]
        faces += [[polygon[0], a, b] for a, b in zip(polygon[1:], polygon[2:], strict=False)]
    return points, np.array(faces, dtype=np.int64).reshape(-1, 3)


def _ply_text(lines: list[str], elements: dict[str, tuple[int, list[list[str]]]]) -> tuple[Points, Faces]:
    count, columns = elements["vertex"]
    names = [column[-1] for column in columns]
    table = np.array([line.split()[: len(names)] for line in lines[:count]], dtype=np.float64)
    points = table[:, [names.index(axis) for axis in "xyz"]]
    faces = []
    for line in lines[count : count + elements["face"][0]]:
        values = [int(float(word)) for word in line.split()]
        polygon = values[1 : 1 + values[0]]
        faces += [[polygon[0], a, b] for a, b in zip(polygon[1:], polygon[2:], strict=False)]
    return points, np.array(faces, dtype=np.int64).reshape(-1, 3)
