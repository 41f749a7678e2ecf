# SPDX-License-Identifier: Apache-2.0
"""Reads a robot's URDF file, adds its links to a scene as bodies, and computes their poses from joint positions.

    robot = Urdf("arm.urdf")
    robot.add_to(bodies)  # activestereo.scene_io.bodies
    bodies.move(robot.poses(joints))  # [links, 4, 4] of [joints], or [E, links, 4, 4] of [E, joints]

Reads visual elements: boxes, spheres, cylinders, colours, and meshes with their own materials and textures. A
<material> with a colour replaces these. Collisions, inertias and a <material>'s texture are not read.
"""

from __future__ import annotations

import logging
import re
import xml.etree.ElementTree as xml
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

import kuafu
from activestereo.common.input_files import read_bytes
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape
from activestereo.scene_io.parts import LARGEST_M, Part, add_parts, read_parts

_LOG = logging.getLogger("activestereo.integrations.urdf")

Colour = tuple[float, float, float, float]
_GREY: Colour = (0.6, 0.6, 0.6, 1.0)
_MOVES = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class _Visual:
    parts: Sequence[Part]
    to_link: NDArray[np.float64]  # 4x4, scale included
    colour: Colour | None  # the URDF material's colour, which replaces the parts' own materials


@dataclass(frozen=True)
class _Joint:
    """A joint between two links (parent, child: their numbers). Its position is factor * (position of the joint
    `driver`) + offset. to_parent: 4x4, the joint's origin in the parent link."""

    name: str
    kind: str
    parent: int
    child: int
    to_parent: NDArray[np.float64]
    axis: NDArray[np.float64]
    driver: str
    factor: float
    offset: float


class Urdf:
    """Reads a robot's links, joints and visual shapes from a URDF file.

    packages: {name: folder} for meshes at package://name/...; other packages are looked for in the folders above the
    file. Raises ValueError with the file and the fault."""

    def __init__(self, path: str | Path, packages: Mapping[str, str | Path] | None = None) -> None:
        self._path = Path(path)
        self._packages = dict(packages or {})
        try:
            root = xml.parse(self._path).getroot()
        except (OSError, xml.ParseError) as error:
            raise ValueError(f"{path}: cannot be read as URDF: {error}") from error
        links = root.findall("link")
        if root.tag != "robot" or not links:
            raise ValueError(f"{path}: is no URDF: it needs a <robot> with at least one <link>")
        self.name = root.get("name", "robot")
        self.link_names = [self._text(link, "name") for link in links]
        colours = {m.get("name", ""): colour for m in root.findall("material") if (colour := self._colour(m))}
        self._visuals = [[self._visual(v, colours) for v in link.findall("visual")] for link in links]
        self._joints = self._sort_joints([self._joint(joint) for joint in root.findall("joint")])
        self.joint_names = [j.name for j in self._joints if j.kind in _MOVES and j.driver == j.name]
        unknown = next((j for j in self._joints if j.kind in _MOVES and j.driver not in self.joint_names), None)
        if unknown is not None:
            raise ValueError(f"{path}: joint '{unknown.name}' mimics '{unknown.driver}', which does not move by itself")

    def add_to(self, bodies: Bodies, prefix: str = "") -> list[int]:
        """Adds a body for each link, in the order of link_names. The body's name is `prefix` and the link's name.
        Returns the bodies' numbers."""
        out = []
        for name, visuals in zip(self.link_names, self._visuals, strict=True):
            shapes = []
            for visual in visuals:
                parts = [
                    Part(part.mesh, material=kuafu.Material(base_color=visual.colour or _GREY))
                    if visual.colour or (part.material is None and part.colors is None)
                    else part
                    for part in visual.parts
                ]
                numbers = add_parts(bodies.scene, parts, name)
                shapes += [Shape(mesh, [material], visual.to_link) for mesh, material in numbers]
            out.append(bodies.add(prefix + name, shapes))
        return out

    def poses(self, joints: Mapping[str, ArrayLike] | ArrayLike, base: ArrayLike | None = None) -> NDArray[np.float64]:
        """Computes the links' poses in the world, [..., links, 4, 4]. joints: [..., joints] in the order of
        joint_names, radians and metres, or {name: [...]} with the others at 0. base: the root link's pose, 4x4 or [...,
        4, 4]; None: identity."""
        position: dict[str, NDArray[np.float64]]
        if isinstance(joints, Mapping):
            unknown = [name for name in joints if name not in self.joint_names]
            if unknown:
                raise ValueError(f"there is no joint '{unknown[0]}' to move (known: {', '.join(self.joint_names)})")
            given = {name: np.asarray(value, np.float64) for name, value in joints.items()}
            broadcast = np.broadcast_shapes(*(value.shape for value in given.values()))
            zero = np.zeros(broadcast)
            position = {name: np.broadcast_to(given.get(name, zero), broadcast) for name in self.joint_names}
        else:
            array = np.asarray(joints, np.float64)
            if array.shape[-1:] != (len(self.joint_names),):
                raise ValueError(f"joints of '{self.name}' are [..., {len(self.joint_names)}], not {array.shape}")
            position = dict(zip(self.joint_names, np.moveaxis(array, -1, 0), strict=True))
        shape = next(iter(position.values())).shape if position else ()
        out = np.zeros((*shape, len(self.link_names), 4, 4))
        children = {joint.child for joint in self._joints}
        for link in range(len(self.link_names)):
            if link not in children:
                out[..., link, :, :] = np.eye(4) if base is None else np.asarray(base, np.float64)
        for joint in self._joints:
            pose = out[..., joint.parent, :, :] @ joint.to_parent
            if joint.kind in _MOVES:
                at = joint.factor * position[joint.driver] + joint.offset
                motion = np.broadcast_to(np.eye(4), (*at.shape, 4, 4)).copy()
                if joint.kind == "prismatic":
                    motion[..., :3, 3] = at[..., None] * joint.axis
                else:
                    turns = Rotation.from_rotvec(at.reshape(-1, 1) * joint.axis)
                    motion[..., :3, :3] = turns.as_matrix().reshape(*at.shape, 3, 3)
                pose = pose @ motion
            out[..., joint.child, :, :] = pose
        return out

    # ---- reading ----

    def _joint(self, element: xml.Element) -> _Joint:
        name, kind = self._text(element, "name"), self._text(element, "type")
        if kind not in (*_MOVES, "fixed"):
            raise ValueError(f"{self._path}: joint '{name}' is {kind}; known are {', '.join(_MOVES)} and fixed")
        ends = []
        for end in ("parent", "child"):
            found = element.find(end)
            link = "" if found is None else found.get("link", "")
            if link not in self.link_names:
                raise ValueError(f"{self._path}: the {end} of joint '{name}' is '{link}', which is no link")
            ends.append(self.link_names.index(link))
        found = element.find("axis")
        axis = self._numbers("1 0 0" if found is None else found.get("xyz", "1 0 0"), 3)
        if kind in _MOVES and not np.linalg.norm(axis) > 0:
            raise ValueError(f"{self._path}: the axis of joint '{name}' has no direction")
        mimic = element.find("mimic")
        driver, factor, offset = name, 1.0, 0.0
        if mimic is not None:
            driver = mimic.get("joint", "")
            factor, offset = (self._numbers(mimic.get(k, d), 1)[0] for k, d in (("multiplier", "1"), ("offset", "0")))
        length = float(np.linalg.norm(axis)) or 1.0
        return _Joint(name, kind, ends[0], ends[1], self._origin(element), axis / length, driver, factor, offset)

    def _sort_joints(self, joints: list[_Joint]) -> list[_Joint]:
        """Returns the joints sorted, parents before children. Raises ValueError if they form no tree."""
        children = [joint.child for joint in joints]
        placed = set(range(len(self.link_names))) - set(children)
        out: list[_Joint] = []
        while len(out) < len(joints):
            ready = [j for j in joints if j not in out and j.parent in placed and j.child not in placed]
            if not ready:
                raise ValueError(f"{self._path}: the joints are no tree: a link hangs on itself, or on two others")
            out += ready
            placed |= {joint.child for joint in ready}
        if len(set(children)) < len(children):
            raise ValueError(f"{self._path}: the joints are no tree: a link hangs on two others")
        return out

    def _visual(self, element: xml.Element, colours: Mapping[str, Colour]) -> _Visual:
        material = element.find("material")
        own = None if material is None else self._colour(material) or colours.get(material.get("name", ""))
        geometry = element.find("geometry")
        kind = None if geometry is None else next(iter(geometry), None)
        if kind is None:
            raise ValueError(f"{self._path}: a <visual> has no geometry")
        # A mesh file, or a unit solid and the 4x4 that gives it its size.
        if kind.tag == "mesh":
            parts, to_visual = self._mesh(kind)
            return _Visual(parts, self._origin(element) @ to_visual, own)
        if kind.tag == "box":
            mesh, scale = solids.box(), 0.5 * self._numbers(kind.get("size", ""), 3)
        elif kind.tag == "sphere":
            mesh, scale = solids.sphere(), np.full(3, self._numbers(kind.get("radius", ""), 1)[0])
        elif kind.tag == "cylinder":
            radius, length = (self._numbers(kind.get(key, ""), 1)[0] for key in ("radius", "length"))
            mesh, scale = solids.cylinder(), np.array([radius, radius, 0.5 * length])
        else:
            raise ValueError(f"{self._path}: the geometry <{kind.tag}> is not known (box, sphere, cylinder, mesh)")
        return _Visual([Part(mesh)], self._origin(element) @ np.diag([*scale, 1.0]), own)

    def _mesh(self, kind: xml.Element) -> tuple[Sequence[Part], NDArray[np.float64]]:
        """Reads a mesh file's parts, and returns them with the 4x4 from its coordinates to the visual's; URDF's scale
        sets the unit."""
        path, scale = self._file(kind.get("filename", "")), self._numbers(kind.get("scale", "1 1 1"), 3)
        try:
            parts = read_parts(path)
        except ValueError as error:
            raise ValueError(f"{self._path}: {error}") from error
        # A scene turns Collada's up axis to y; a link takes coordinates as they stand, as RViz and Gazebo do.
        to_visual = np.diag([*scale, 1.0])
        if path.suffix.lower() == ".dae":
            found = re.search(rb"<up_axis>\s*([XYZ])_UP", read_bytes(path).replace(b"\0", b""))
            to_visual[:3, :3] = to_visual[:3, :3] @ _FROM_Y_UP.get(found[1] if found else b"Y", np.eye(3))
        points = np.vstack([part.mesh.positions for part in parts]) @ to_visual[:3, :3].T
        size_m = float(np.ptp(points, axis=0).max())
        if size_m > LARGEST_M:
            small = 'scale="0.001 0.001 0.001"'
            _LOG.warning(
                "%s: %s is %g m long: if it is in millimetres, its mesh needs %s", self._path, path, size_m, small
            )
        return parts, to_visual

    def _origin(self, element: xml.Element) -> NDArray[np.float64]:
        """Returns the 4x4 of an element's <origin xyz rpy>: roll, pitch and yaw about fixed axes."""
        out, found = np.eye(4), element.find("origin")
        if found is None:
            return out
        out[:3, :3] = Rotation.from_euler("xyz", self._numbers(found.get("rpy", "0 0 0"), 3)).as_matrix()
        out[:3, 3] = self._numbers(found.get("xyz", "0 0 0"), 3)
        return out

    def _colour(self, material: xml.Element) -> Colour | None:
        found = material.find("color")
        if found is None:
            return None
        red, green, blue, alpha = (float(min(max(v, 0.0), 1.0)) for v in self._numbers(found.get("rgba", ""), 4))
        return red, green, blue, alpha

    def _file(self, name: str) -> Path:
        if name.startswith("package://"):
            package, _, rest = name.removeprefix("package://").partition("/")
            folders = [Path(self._packages[package])] if package in self._packages else []
            folders += [up / package for up in self._path.resolve().parents]
            folders += [up for up in self._path.resolve().parents if up.name == package]
        else:
            folders, rest = [self._path.parent], name.removeprefix("file://")
        for folder in folders:
            if (folder / rest).is_file():
                return folder / rest
        raise ValueError(f"{self._path}: the mesh {name} is not there; packages={{name: folder}} says where they are")

    def _text(self, element: xml.Element, key: str) -> str:
        value = element.get(key)
        if not value:
            raise ValueError(f"{self._path}: a <{element.tag}> has no {key}")
        return value

    def _numbers(self, text: str, count: int) -> NDArray[np.float64]:
        try:
            values = np.array([float(part) for part in text.split()])
        except ValueError:
            values = np.empty(0)
        if len(values) != count or not np.isfinite(values).all():
            raise ValueError(f"{self._path}: {count} finite number{'s' if count > 1 else ''} needed, not '{text}'")
        return values


_FROM_Y_UP = {
    b"X": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    b"Z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
