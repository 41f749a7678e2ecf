# SPDX-License-Identifier: Apache-2.0
"""Converts a USD stage to one .glb file, in metres with y up."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.scene_io import USD_ENDINGS
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.usd import shapes, surfaces
from activestereo.scene_io.usd.shapes import Stage, UsdError, cause, columns, open_stage
from activestereo.scene_io.usd.surfaces import Surfaces

if TYPE_CHECKING:
    import kuafu


@dataclass(frozen=True)
class Converted:
    """Holds what a .glb file cannot: the dome light's radiance, and messages about content that was not converted."""

    ambient: tuple[float, float, float] | None  # radiance of the stage's dome light; None: it has none
    messages: tuple[str, ...]


def is_usd(path: str | PathLike[str]) -> bool:
    return Path(path).suffix.lower() in USD_ENDINGS


def convert(path: str | PathLike[str], glb: str | Path, time_s: float | None = None) -> Converted:
    """Writes the stage at `path` to the file `glb`. time_s: seconds after the stage's first time code; None: each
    attribute's earliest sample. Raises UsdError with a text of one line."""
    stage = open_stage(Path(path), time_s)
    from pxr import Tf  # open_stage says where it is missing

    try:
        conversion = _Conversion(stage)
        for prim in conversion.visible(stage.stage.GetPseudoRoot()):
            try:
                conversion.add(prim, columns(conversion.cache.GetLocalToWorldTransform(prim)))
            except UsdError:
                raise
            except Tf.ErrorException as error:
                stage.tell(f"{prim.GetPath()} is left out: {cause(error)}")
            except (ArithmeticError, LookupError, TypeError, ValueError):
                stage.tell(f"{prim.GetPath()} is left out: an attribute is not of the type that its schema has")
    except Tf.ErrorException as error:
        raise UsdError(f"{path}: cannot be shown: {cause(error)}") from error
    if not conversion.shown:
        why = f": {stage.messages[-1]}" if stage.messages else ""
        raise UsdError(f"{path}: there is no mesh in it that can be shown{why}")
    conversion.writer.write(glb)
    return Converted(conversion.ambient, tuple(stage.messages))


def load_usd(
    scene: kuafu.Scene, path: str | PathLike[str], time_s: float | None = None, unit_m: float = 1.0
) -> Converted:
    """Adds the stage at `path` to the scene. unit_m: factor on its size in metres. Raises UsdError of one line, and the
    errors of Scene.load."""
    with tempfile.TemporaryDirectory() as folder:
        glb = Path(folder) / "stage.glb"
        converted = convert(path, glb, time_s)
        scene.load(glb, np.diag([unit_m, unit_m, unit_m, 1.0]), name=path)
    return converted


class _Conversion:
    def __init__(self, stage: Stage) -> None:
        from pxr import UsdGeom

        self.stage, self.writer = stage, GltfWriter("activestereo usd")
        self.surfaces = Surfaces(stage, self.writer)
        self.ambient: tuple[float, float, float] | None = None
        self.shown = 0
        self.cache = UsdGeom.XformCache(stage.time)
        self._to_metres = stage.to_metres()
        self._shapes: dict[Any, list[int]] = {}

    def visible(self, root: Any) -> Iterator[Any]:
        """Yields the visible prims below a prim, instances included, but not the prototypes below a PointInstancer."""
        from pxr import Usd, UsdGeom

        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
        for prim in prims:
            image = UsdGeom.Imageable(prim)
            if not image:
                continue
            hidden = self.stage.value(image.GetVisibilityAttr()) == "invisible"
            if hidden or image.ComputePurpose() not in ("default", "render"):
                prims.PruneChildren()
                continue
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
            yield prim

    def add(self, prim: Any, to_stage: np.ndarray) -> None:
        from pxr import UsdGeom, UsdLux, UsdShade

        to_world = self._to_metres @ to_stage
        if prim.IsA(UsdGeom.Mesh):
            if prim.HasAPI(UsdLux.LightAPI):
                self.stage.tell(f"{prim.GetPath()}: light from a mesh is not read: it shows its material")
            self._place(prim, self._mesh_of(prim), to_world)
        elif prim.IsA(UsdGeom.PointInstancer):
            self._copies(UsdGeom.PointInstancer(prim), to_stage)
        elif prim.IsA(UsdGeom.Camera):
            self._camera(prim, to_world)
        elif prim.GetTypeName() in ("DomeLight", "DomeLight_1"):
            dome = UsdLux.DomeLight(prim)
            if self.stage.value(dome.GetTextureFileAttr()) is not None:
                self.stage.tell(
                    f"{prim.GetPath()}: of a dome light the colour is read: give its picture by --environment"
                )
            light = surfaces.radiance(self.stage, UsdLux.LightAPI(prim)) + np.array(self.ambient or 0.0)
            red, green, blue = light.tolist()
            self.ambient = (red, green, blue)
        elif prim.HasAPI(UsdLux.LightAPI):
            surfaces.add_lamp(self.stage, self.writer, prim, to_stage, to_world)
        elif prim.IsA(UsdGeom.Gprim):
            mesh = shapes.solid(self.stage, prim)
            if mesh is None:
                self.stage.tell(f"{prim.GetPath()} is left out: {prim.GetTypeName()} is not read: export it as a mesh")
            else:
                material = self.surfaces.material_and_texture_coordinates(
                    prim, UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
                )[0]
                self._place(prim, [self.writer.add_shape(str(prim.GetPath()), mesh, material)], to_world)
        elif prim.GetTypeName() == "SkelRoot":
            self.stage.tell("skins are shown as their meshes are without a skeleton")

    def _place(self, prim: Any, found: list[int], to_world: np.ndarray) -> None:
        if not np.array_equal(to_world[3], [0, 0, 0, 1]):
            self.stage.tell(f"{prim.GetPath()} is left out: its matrix is a projection, not a place")
            return
        for shape in found:
            self.writer.place(str(prim.GetPath()), shape, to_world)
            self.shown += 1

    def _mesh_of(self, prim: Any) -> list[int]:
        """Returns the indices of the prim's meshes in the glTF file, one for each material. Instances share those of
        their prototype."""
        from pxr import UsdGeom, UsdShade

        binding = UsdShade.MaterialBindingAPI(prim)
        looks = [self.surfaces.material_and_texture_coordinates(prim, binding.ComputeBoundMaterial()[0])]
        shared = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        key = shared.GetPath(), looks[0]
        if key in self._shapes:
            return self._shapes[key]
        mesh = UsdGeom.Mesh(prim)
        found = shapes.triangles_of(self.stage, mesh)
        out: list[int] = []
        if found is not None:
            cut, whole = found
            face_look = np.zeros(int(cut.corner_face.max()) + 1, dtype=np.int64)
            for subset in binding.GetMaterialBindSubsets():
                material = UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()[0]
                faces = np.asarray(self.stage.value(subset.GetIndicesAttr(), []), dtype=np.int64)
                faces = faces[(faces >= 0) & (faces < len(face_look))]
                look = self.surfaces.material_and_texture_coordinates(subset.GetPrim(), material)
                if look not in looks:
                    looks.append(look)
                face_look[faces] = looks.index(look)
            for number in np.unique(face_look[cut.faces]):
                material_number, uv_name = looks[number]
                placed = shapes.textured(self.stage, mesh, cut, whole, uv_name)
                part = shapes.part(placed, face_look[cut.faces] == number)
                out.append(self.writer.add_shape(str(prim.GetPath()), part, material_number))
        self._shapes[key] = out
        return out

    def _copies(self, instancer: Any, to_stage: np.ndarray) -> None:
        prototypes = instancer.GetPrototypesRel().GetForwardedTargets()
        matrices = instancer.ComputeInstanceTransformsAtTime(self.stage.time, self.stage.time)
        numbers = list(self.stage.value(instancer.GetProtoIndicesAttr(), []))
        mask = list(instancer.ComputeMaskAtTime(self.stage.time)) or [True] * len(numbers)
        numbers = [number for number, seen in zip(numbers, mask, strict=True) if seen]
        if len(matrices) != len(numbers):
            self.stage.tell(f"{instancer.GetPath()}: its copies cannot be placed: its places or prototypes do not fit")
            return
        for number, matrix in zip(numbers, matrices, strict=True):
            root = self.stage.stage.GetPrimAtPath(prototypes[number])
            above = np.linalg.inv(columns(self.cache.GetLocalToWorldTransform(root)))
            for prim in self.visible(root):
                # The copy's matrix includes its prototype's own transform.
                inside = above @ columns(self.cache.GetLocalToWorldTransform(prim))
                self.add(prim, to_stage @ columns(matrix) @ inside)

    def _camera(self, prim: Any, to_world: np.ndarray) -> None:
        from pxr import Gf, UsdGeom

        camera = UsdGeom.Camera(prim).GetCamera(self.stage.time)
        if camera.projection != Gf.Camera.Perspective:
            self.stage.tell(f"{prim.GetPath()}: an orthographic camera is left out")
            return
        if camera.horizontalApertureOffset or camera.verticalApertureOffset:
            self.stage.tell(f"{prim.GetPath()}: its aperture's offset is not read")
        angle = np.deg2rad(camera.GetFieldOfView(Gf.Camera.FOVVertical))
        pose = to_world.copy()
        pose[:3, :3] /= np.linalg.norm(pose[:3, :3], axis=0)
        self.writer.add_camera(str(prim.GetPath()), pose @ np.diag([1, -1, -1, 1]), float(angle), camera.aspectRatio)
