# SPDX-License-Identifier: Apache-2.0
"""Mirrors a MuJoCo model in a kuafu scene whose bodies follow the state.

    world = MujocoScene(model, data)
    sensor = StereoDepthSensor(StereoDepthSensorConfig("D435"), world.mount("wrist"))
    mujoco.mj_step(model, data)
    world.update()
    sensor.take_picture()

A list of states of one model is a batch: each state is an environment, and StereoDepthSensorBatch takes mount()'s
result.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.pose import CAMERA_TO_BODY
from activestereo.integrations.mujoco.geoms import (
    Looks,
    ambient_radiance,
    cube_uvs,
    geom_mesh,
    has_own_uvs,
    light,
    plane_uvs,
)
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh

# A MuJoCo camera looks along -z with y up.
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


class MujocoMirrorWarning(UserWarning):
    """Warns that a part of a model has no counterpart in the scene."""


class MujocoScene:
    """Mirrors the visible geoms, materials, textures and lights of a model.

    data: the state, after mj_forward(); a list of states is a batch of environments. groups: the geoms' groups that are
    seen (MuJoCo's viewer shows 0 to 2). device: 'auto', 'cpu', an index or a kuafu.Device. scene: the scene that the
    model is added to; None: a new one. Skins, flexes and tendons are left out, with a MujocoMirrorWarning.
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
        self._lights: list[tuple[int, int, int | None]] = []  # numbers in the scene and in the model, environment
        for environment, state in enumerate(self._states):
            for number in range(model.nlight):
                where = environment if self.is_batch else None
                record = light(model, state, number, where)
                if record is not None:
                    self._lights.append((self.scene.add_light(record), number, where))
        self.scene.set_environment(ambient_radiance(model))
        counts = {"skins": model.nskin, "flexes": model.nflex, "tendons": model.ntendon}
        left_out = [f"{count} {what}" for what, count in counts.items() if count]
        if left_out:
            text = f"the scene lacks {', '.join(left_out)} of the model: only geoms are mirrored"
            warnings.warn(text, MujocoMirrorWarning, stacklevel=2)
        self.update()

    def update(self) -> int:
        """Moves the scene to the present states. Returns the number of geoms that moved. Raises BodyPoseError, with
        environment and geom, if a state has turned NaN; the other environments have moved."""
        for in_scene, number, environment in self._lights:
            record = light(self.model, self._states[environment or 0], number, environment)
            before = self.scene.get_light(in_scene)
            if record is not None and not np.array_equal(record.light_to_world, before.light_to_world):
                self.scene.set_light(in_scene, record)
        poses = np.zeros((len(self._states), len(self._geoms), 4, 4))
        for pose, data in zip(poses, self._states, strict=True):
            pose[:, :3, :3] = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
            pose[:, :3, 3] = data.geom_xpos[self._geoms]
        poses[..., 3, 3] = 1.0
        return self.bodies.move(poses if self.is_batch else poses[0])

    def mount(self, camera: str | None = None, body: str | None = None) -> MujocoMount:
        """Returns a mount for a sensor: a camera of the model (x forward along its direction), or a body (axes x
        forward, y left, z up). Raises ValueError unless exactly one is named and exists."""
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

    def geom_of(self, semantic_id: int) -> str:
        """Returns the name of the geom that a pixel of the picture 'semantic_id' shows. semantic_id: the pixel's value,
        the geom's number + 1 (0 = no geom)."""
        return self._name(semantic_id - 1)

    def _mesh(self, geom: int) -> int | None:
        """Returns the number of a geom's mesh in the scene; geoms of the same shape and texturing share one. None: it
        has no surface."""
        model, material = self.model, int(self.model.geom_matid[geom])
        kind = self._looks.texture_kind(geom)
        shape = (int(model.geom_type[geom]), int(model.geom_dataid[geom]), model.geom_size[geom].tobytes())
        key = (*shape, -1 if kind is None else material)
        if key not in self._meshes:
            mesh = geom_mesh(model, geom)
            if mesh is None or not len(mesh.indices):
                return None
            if kind == mujoco.mjtTexture.mjTEXTURE_CUBE:
                mesh = cube_uvs(mesh, bool(model.mat_texuniform[material]))
            elif kind is not None and not has_own_uvs(model, geom):
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
