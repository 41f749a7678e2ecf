# SPDX-License-Identifier: Apache-2.0
"""Simulates a depth sensor in MuJoCo: the scene comes from the model, poses from the state. Needs the package mujoco.

A light's `intensity`, if set, is in candela; LUMENS_PER_WATT converts it to W/sr. Other lights have no unit: a
Lambertian surface that faces a light of `diffuse` d has a radiance of d times its colour. The irradiance of such a
light is pi d. A spot light gives this irradiance at the middle of the model (`statistic/center`) and falls off with the
square of the distance; MuJoCo's lights have no fall-off by default."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.pose import CAMERA_TO_BODY, look_at
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh
from activestereo.scene_io.meshes import Mesh
from activestereo.scene_io.staging import LUMENS_PER_WATT

# MJCF's default colour: a geom with it has no colour of its own and takes its material's.
_DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)
# A geom without a material has the gloss of MJCF's default material.
_DEFAULT_SPECULAR, _DEFAULT_SHININESS = 0.5, 0.5


class Looks:
    """Adds a model's materials and textures to the scene, each once."""

    def __init__(self, model: mujoco.MjModel, scene: kuafu.Scene) -> None:
        self._model, self._scene = model, scene
        self._textures: dict[int, int] = {}
        self._materials: dict[tuple[int, tuple[float, ...]], int] = {}

    def material(self, geom: int) -> int:
        """Returns the number of the geom's material in the scene."""
        key = (int(self._model.geom_matid[geom]), _rgba(self._model, geom))
        if key not in self._materials:
            fields, texture = geom_surface(self._model, geom), self.colour_texture(key[0])
            if texture is not None:
                fields["base_color_texture"] = self._texture(texture)
            self._materials[key] = self._scene.add_material(kuafu.Material(**fields))
        return self._materials[key]

    def colour_texture(self, number: int) -> int | None:
        """Returns the number of a material's colour texture; None without one."""
        if number < 0:
            return None
        roles = mujoco.mjtTextureRole
        for role in (roles.mjTEXROLE_RGB, roles.mjTEXROLE_RGBA):
            texture = int(self._model.mat_texid[number, role])
            if texture >= 0 and self._model.tex_type[texture] != mujoco.mjtTexture.mjTEXTURE_SKYBOX:
                return texture
        return None

    def _texture(self, number: int) -> int:
        if number not in self._textures:
            model, name = self._model, self._model.texture(number).name
            is_linear = model.tex_colorspace[number] == mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR
            shape = [int(a[number]) for a in (model.tex_height, model.tex_width, model.tex_nchannel)]
            data = model.tex_data[model.tex_adr[number] :][: int(np.prod(shape))]
            texels = np.ascontiguousarray(data.reshape(shape))  # row 0 on top
            self._textures[number] = self._scene.add_texture(texels, srgb=not is_linear, name=name)
        return self._textures[number]


def geom_surface(model: mujoco.MjModel, geom: int) -> dict[str, Any]:
    """Returns the fields of a kuafu.Material for a geom, without textures."""
    number, rgba = int(model.geom_matid[geom]), _rgba(model, geom)
    red, green, blue, alpha = (min(max(v, 0.0), 1.0) for v in rgba)
    if number < 0:
        shine = {"roughness": 1.0 - _DEFAULT_SHININESS, "specular": _DEFAULT_SPECULAR}
        return {"base_color": (red, green, blue, alpha), **shine}
    rough, metallic = float(model.mat_roughness[number]), float(model.mat_metallic[number])
    return {
        "name": model.material(number).name,
        "base_color": (red, green, blue, alpha),
        "roughness": rough if rough >= 0 else 1.0 - float(np.clip(model.mat_shininess[number], 0, 1)),
        "specular": float(np.clip(model.mat_specular[number], 0, 1)),
        "metallic": max(metallic, 0.0),
        "emission": tuple(float(model.mat_emission[number]) * v for v in (red, green, blue)),
    }


def _rgba(model: mujoco.MjModel, geom: int) -> tuple[float, ...]:
    """Returns the geom's own colour, or its material's if it has none of its own."""
    number, rgba = int(model.geom_matid[geom]), tuple(float(v) for v in model.geom_rgba[geom])
    if number >= 0 and np.allclose(rgba, _DEFAULT_RGBA):
        return tuple(float(v) for v in model.mat_rgba[number])
    return rgba


def ambient_radiance(model: mujoco.MjModel) -> tuple[float, float, float]:
    """Returns the model's uniform radiance from all sides: MuJoCo's ambient terms and the headlight, which belongs to
    the viewer and not to the room."""
    head = model.vis.headlight
    total = (np.asarray(head.ambient) + np.asarray(head.diffuse)) * bool(head.active) + np.zeros(3)
    for light in range(model.nlight):
        total += model.light_ambient[light] * bool(model.light_active[light])
    red, green, blue = (float(v) for v in total)
    return red, green, blue


def light(model: mujoco.MjModel, data: mujoco.MjData, number: int, environment: int | None) -> kuafu.Light | None:
    """Returns the model's light `number` at its pose in the state; None if it is off or gives no diffuse light.
    environment: number of the only environment that sees it; None: all see it."""
    diffuse = np.asarray(model.light_diffuse[number], dtype=np.float64)
    if not model.light_active[number] or not diffuse.any():
        return None
    at, along = data.light_xpos[number], data.light_xdir[number]
    up = np.eye(3)[np.abs(along).argmin()]
    pose = look_at(at, at + along, up)
    name = model.light(number).name
    kind, shape, intensity = "point", {}, np.pi * diffuse
    if model.light_type[number] == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL:
        kind = "directional"
    else:
        intensity *= float(np.linalg.norm(at - model.stat.center)) ** 2
    if model.light_type[number] == mujoco.mjtLightType.mjLIGHT_SPOT:
        outer = float(np.deg2rad(min(model.light_cutoff[number], 90.0)))
        kind, shape = "spot", {"inner_rad": 0.5 * outer, "outer_rad": outer}
    candela = float(getattr(model, "light_intensity", np.zeros(model.nlight))[number])
    if candela > 0.0 and kind != "directional":
        intensity = diffuse * candela / LUMENS_PER_WATT
    red, green, blue = (float(v) for v in intensity)
    return kuafu.Light(
        name=name, kind=kind, intensity=(red, green, blue), light_to_world=pose, environment=environment, **shape
    )


# Half the side of a plane that is infinite in MuJoCo, as a multiple of the model's extent.
_ENDLESS_EXTENTS = 10.0
_CUBE_FACES = 6
# Texture coordinates end short of the square's edge, so that filtering does not blend in the next square.
_INSIDE = 0.999


def geom_mesh(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """Returns the geom's surface in metres, in its own frame; None for kinds of geoms without a surface."""
    kinds = mujoco.mjtGeom
    kind, size = kinds(int(model.geom_type[geom])), model.geom_size[geom]
    if kind == kinds.mjGEOM_PLANE:
        endless_m = _ENDLESS_EXTENTS * model.stat.extent
        return _scaled(solids.rectangle(), [s if s > 0 else endless_m for s in size[:2]] + [1.0])
    if kind == kinds.mjGEOM_BOX:
        return _scaled(solids.box(), size)
    if kind == kinds.mjGEOM_SPHERE:
        return _scaled(solids.sphere(), size[[0, 0, 0]])
    if kind == kinds.mjGEOM_ELLIPSOID:
        return _scaled(solids.sphere(), size)
    if kind == kinds.mjGEOM_CYLINDER:
        return _scaled(solids.cylinder(), size[[0, 0, 1]])
    if kind == kinds.mjGEOM_CAPSULE:
        return solids.capsule(float(size[0]), float(size[1]))
    if kind in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF) and model.geom_dataid[geom] >= 0:
        return _model_mesh(model, model.geom_dataid[geom])
    if kind == kinds.mjGEOM_HFIELD:
        field = model.geom_dataid[geom]
        rows, columns = model.hfield_nrow[field], model.hfield_ncol[field]
        data = model.hfield_data[model.hfield_adr[field] :][: rows * columns].reshape(rows, columns)
        half_x, half_y, height, _ = model.hfield_size[field]
        return solids.height_field(data.astype(np.float64) * height, half_x, half_y)
    return None


def has_own_uvs(model: mujoco.MjModel, geom: int) -> bool:
    """Returns whether the geom's mesh came with texture coordinates."""
    mesh = model.geom_dataid[geom]
    kinds = mujoco.mjtGeom
    is_mesh = kinds(int(model.geom_type[geom])) in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF)
    return bool(is_mesh and mesh >= 0 and model.mesh_texcoordadr[mesh] >= 0)


def plane_uvs(mesh: Mesh, repeat: NDArray[np.float64], is_uniform: bool) -> Mesh:
    """Returns the mesh with texture coordinates that lay a 2D texture over x and y. repeat: [2], how often it repeats
    over the geom, or per metre if is_uniform."""
    at = mesh.positions[:, :2] * [1.0, -1.0]
    half = 1.0 if is_uniform else 2.0 * np.abs(mesh.positions[:, :2]).max(axis=0).clip(1e-9)
    return replace(mesh, uvs=np.ascontiguousarray(at / half * repeat + 0.5 * (not is_uniform), np.float32))


def cube_uvs(mesh: Mesh, is_uniform: bool) -> Mesh:
    """Returns the mesh with texture coordinates of a cube map, projected from the geom's middle by OpenGL's rule. The
    texture's six squares lie below one another (+x, -x, +y, -y, +z, -z). Each triangle uses the square that its middle
    falls into."""
    half = 1.0 if is_uniform else np.abs(mesh.positions).max(axis=0).clip(1e-9)
    corners = (mesh.positions / half)[mesh.indices].astype(np.float64)
    middle = corners.mean(axis=1)
    axis = np.abs(middle).argmax(axis=1)
    rows = np.arange(len(axis))
    sign = np.where(middle[rows, axis] < 0, -1.0, 1.0)
    x, y, z = np.moveaxis(corners, -1, 0)
    face, s = axis[:, None], sign[:, None]
    depth = np.choose(face, [abs(x), abs(y), abs(z)]).clip(1e-9)
    u = 0.5 + 0.5 * np.clip(np.choose(face, [-s * z, x, s * x]) / depth, -_INSIDE, _INSIDE)
    v = 0.5 + 0.5 * np.clip(np.choose(face, [-y, s * z, -y]) / depth, -_INSIDE, _INSIDE)
    square = 2 * axis + (sign < 0)
    uvs = np.stack([u, (square[:, None] + v) / _CUBE_FACES], axis=-1)
    return Mesh.from_arrays(
        mesh.positions[mesh.indices].reshape(-1, 3),
        mesh.normals[mesh.indices].reshape(-1, 3),
        uvs.reshape(-1, 2),
        np.arange(3 * len(axis)).reshape(-1, 3),
    )


def _scaled(mesh: Mesh, scale: NDArray[np.float64] | list[float]) -> Mesh:
    normals = mesh.normals / np.asarray(scale)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh.from_arrays(mesh.positions * np.asarray(scale), normals, mesh.uvs, mesh.indices)


def _model_mesh(model: mujoco.MjModel, mesh: int) -> Mesh:
    """Returns a mesh of the model. MuJoCo indexes positions, normals and texture coordinates separately; here each
    vertex has one of each."""
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    vertex, normal = model.mesh_face[faces], model.mesh_facenormal[faces]
    has_uvs = model.mesh_texcoordadr[mesh] >= 0
    uv = model.mesh_facetexcoord[faces] if has_uvs else np.zeros_like(vertex)
    corners, number = np.unique(np.stack([vertex, normal, uv], -1).reshape(-1, 3), axis=0, return_inverse=True)
    positions = model.mesh_vert[model.mesh_vertadr[mesh] + corners[:, 0]]
    normals = model.mesh_normal[model.mesh_normaladr[mesh] + corners[:, 1]]
    uvs = np.zeros((len(corners), 2))
    if has_uvs:
        uvs = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + corners[:, 2]] * [1.0, -1.0] + [0.0, 1.0]
    return Mesh.from_arrays(positions, normals, uvs, number.reshape(-1, 3))


# A MuJoCo camera looks along -z with y up.
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


class MujocoMirrorWarning(UserWarning):
    """Warns that a part of a model has no counterpart in the scene."""


class MujocoScene:
    """Mirrors the visible geoms, materials, textures and lights of a model.

    data: the state, after mj_forward(); a list of states is a batch of environments. groups: the visible groups of
    geoms (MuJoCo's viewer shows 0 to 2). device: 'auto', 'cpu', an index or a kuafu.Device. scene: the scene that the
    model is added to; None: a new one. Skins, flexes and tendons are left out, with a MujocoMirrorWarning. The picture
    'semantic_id' has a geom's number + 1, and 0 where no geom is.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData | Sequence[mujoco.MjData], groups: Sequence[int] = (0, 1, 2),
        device: str | int | kuafu.Device = "auto", scene: kuafu.Scene | None = None,
    ) -> None:  # fmt: skip
        self.model = model
        self.is_batch = not isinstance(data, mujoco.MjData)
        self._states: list[mujoco.MjData] = list(data) if self.is_batch else [data]
        if not self._states:
            raise ValueError("a batch has at least one state")
        self.scene = scene or kuafu.Scene(device if isinstance(device, kuafu.Device) else kuafu.Device(device))
        self.bodies = Bodies(self.scene, len(self._states) if self.is_batch else None)
        self._looks = Looks(model, self.scene)
        self._meshes: dict[tuple[object, ...], int] = {}
        self._geoms: list[int] = []
        for geom in range(model.ngeom):
            is_seen = model.geom_matid[geom] >= 0 or model.geom_rgba[geom, 3] != 0
            number = self._mesh(geom) if is_seen and model.geom_group[geom] in groups else None
            if number is not None:
                shape = Shape(number, [self._looks.material(geom)])
                self.bodies.add(self._name(geom), [shape], semantic_id=geom + 1)
                self._geoms.append(geom)
        # {(environment, number in the model): (number in the scene, pose and intensity there)}
        self._lights: dict[tuple[int, int], tuple[int, tuple[bytes, tuple[float, ...]]]] = {}
        self._ambient: tuple[float, float, float] | None = None
        counts = {"skins": model.nskin, "flexes": model.nflex, "tendons": model.ntendon}
        left_out = [f"{count} {what}" for what, count in counts.items() if count]
        if left_out:
            text = f"the scene lacks {', '.join(left_out)} of the model: only geoms are mirrored"
            warnings.warn(text, MujocoMirrorWarning, stacklevel=2)
        self.update()

    def update(self) -> int:
        """Moves the scene to the present states, and switches, dims and colours its lights as the model has them now.
        Returns the number of geoms that moved. Raises BodyPoseError, with environment and geom, if a state has turned
        NaN; the other environments have moved."""
        for environment, state in enumerate(self._states):
            for number in range(self.model.nlight):
                self._update_light(environment, state, number)
        if (ambient := ambient_radiance(self.model)) != self._ambient:
            self._ambient = ambient
            self.scene.set_environment(ambient)
        poses = np.zeros((len(self._states), len(self._geoms), 4, 4))
        for pose, data in zip(poses, self._states, strict=True):
            pose[:, :3, :3] = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
            pose[:, :3, 3] = data.geom_xpos[self._geoms]
        poses[..., 3, 3] = 1.0
        return self.bodies.move(poses if self.is_batch else poses[0])

    def mount(self, camera: str | None = None, body: str | None = None) -> MujocoMount:
        """Returns a mount for a sensor: a camera of the model, with x forward along its view, or a body, with the
        body's own axes as x forward, y left, z up. Raises ValueError unless exactly one is named and exists."""
        if (camera is None) == (body is None):
            raise ValueError("a mount is on a camera or on a body: name one of them")
        kind = mujoco.mjtObj.mjOBJ_CAMERA if body is None else mujoco.mjtObj.mjOBJ_BODY
        number = mujoco.mj_name2id(self.model, kind, camera or body)
        if number < 0:
            count = self.model.ncam if body is None else self.model.nbody
            known = [mujoco.mj_id2name(self.model, kind, n) or "(unnamed)" for n in range(count)]
            what = "camera" if body is None else "body"
            raise ValueError(f"the model has no {what} '{camera or body}' (known: {', '.join(known) or 'none'})")
        return MujocoMount(self, number, is_camera=body is None)

    def _update_light(self, environment: int, state: mujoco.MjData, number: int) -> None:
        """Adds or changes the light of an environment where it differs from the model's. One that is off stays in the
        scene, dark."""
        record = light(self.model, state, number, environment if self.is_batch else None)
        in_scene, before = self._lights.get((environment, number), (None, None))
        if in_scene is None:
            if record is None:
                return
            in_scene = self.scene.add_light(record)
        elif record is None:
            record = self.scene.get_light(in_scene)
            record.intensity = (0.0, 0.0, 0.0)
        now = np.asarray(record.light_to_world).tobytes(), tuple(record.intensity)
        if before is not None and now != before:
            self.scene.set_light(in_scene, record)
        self._lights[environment, number] = in_scene, now

    def _mesh(self, geom: int) -> int | None:
        """Returns the number of a geom's mesh in the scene, None without a surface. Geoms of equal shape and texturing
        share a mesh."""
        model, material = self.model, int(self.model.geom_matid[geom])
        texture = self._looks.colour_texture(material)
        shape = (int(model.geom_type[geom]), int(model.geom_dataid[geom]), model.geom_size[geom].tobytes())
        key = (*shape, -1 if texture is None else material)
        if key not in self._meshes:
            mesh = geom_mesh(model, geom)
            if mesh is None or not len(mesh.indices):
                return None
            if texture is not None and model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE:
                mesh = cube_uvs(mesh, bool(model.mat_texuniform[material]))
            elif texture is not None and not has_own_uvs(model, geom):
                mesh = plane_uvs(mesh, model.mat_texrepeat[material], bool(model.mat_texuniform[material]))
            self._meshes[key] = add_mesh(self.scene, mesh, self._name(geom))
        return self._meshes[key]

    def _name(self, geom: int) -> str:
        body = self.model.body(self.model.geom_bodyid[geom]).name
        return self.model.geom(geom).name or f"geom {geom} of {body or 'a body'}"


class MujocoMount:
    """Lets a depth sensor follow a camera or body of a MuJoCo model. MujocoScene.mount() makes it; StereoDepthSensor
    (one state) and StereoDepthSensorBatch (a list of states) take it. number: the camera's or the body's in the
    model."""

    def __init__(self, world: MujocoScene, number: int, is_camera: bool) -> None:
        self._world, self._number, self._is_camera = world, number, is_camera
        self.scene = world.scene

    @property
    def poses(self) -> NDArray[np.float64]:
        """Returns the mount's poses in the present states, [E, 4, 4], body axes (x forward, y left, z up)."""
        states, n = self._world._states, self._number
        out = np.zeros((len(states), 4, 4))
        out[:, 3, 3] = 1.0
        for pose, data in zip(out, states, strict=True):
            rotation, position = (data.cam_xmat, data.cam_xpos) if self._is_camera else (data.xmat, data.xpos)
            pose[:3, :3], pose[:3, 3] = rotation[n].reshape(3, 3), position[n]
        return out @ _OPENGL @ CAMERA_TO_BODY.T if self._is_camera else out

    @property
    def pose(self) -> NDArray[np.float64]:
        """Returns the mount's pose [4, 4] in a single state. Raises ValueError for a batch of states."""
        if self._world.is_batch:
            raise ValueError("this world is a batch of states: use poses")
        return np.asarray(self.poses[0])
