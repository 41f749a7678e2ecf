# SPDX-License-Identifier: Apache-2.0
"""A MuJoCo model's materials, textures and lights in kuafu's terms.

A light whose `intensity` is set has candela, which LUMENS_PER_WATT makes W/sr. Others have no unit: a Lambertian
surface that faces a light of `diffuse` d shines with d times its colour. The irradiance of such a light is pi d. A spot
light gives this irradiance at the middle of the model (`statistic/center`) and falls off with the square of the
distance; MuJoCo's lights have no fall-off by default.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.pose import look_at
from activestereo.scene_io.lamp_kinds import LUMENS_PER_WATT

# MJCF's default for a geom without a colour; such a geom takes its material's.
_DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)
# A geom without a material shines as MJCF's default material does.
_DEFAULT_SPECULAR, _DEFAULT_SHININESS = 0.5, 0.5


class Looks:
    """The materials and textures of a model that are in the scene, each once."""

    def __init__(self, model: mujoco.MjModel, scene: kuafu.Scene) -> None:
        self._model, self._scene = model, scene
        self._textures: dict[int, int] = {}
        self._materials: dict[tuple[int, tuple[float, ...]], int] = {}

    def material(self, geom: int) -> int:
        """The scene's material of a geom."""
        key = (int(self._model.geom_matid[geom]), _rgba(self._model, geom))
        if key not in self._materials:
            fields, texture = geom_surface(self._model, geom), self._colour_texture(key[0])
            if texture is not None:
                fields["base_color_texture"] = self._texture(texture)
            self._materials[key] = self._scene.add_material(kuafu.Material(**fields))
        return self._materials[key]

    def texture_kind(self, geom: int) -> int | None:
        """MuJoCo's kind of the colour texture on a geom, or None."""
        texture = self._colour_texture(int(self._model.geom_matid[geom]))
        return None if texture is None else int(self._model.tex_type[texture])

    def _colour_texture(self, number: int) -> int | None:
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
            name = self._model.texture(number).name
            is_linear = self._model.tex_colorspace[number] == mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR
            texels = texture_image(self._model, number)
            self._textures[number] = self._scene.add_texture(texels, srgb=not is_linear, name=name)
        return self._textures[number]


def geom_surface(model: mujoco.MjModel, geom: int) -> dict[str, Any]:
    """Fields of a kuafu.Material without textures."""
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
    """A geom's own colour, or its material's."""
    number, rgba = int(model.geom_matid[geom]), tuple(float(v) for v in model.geom_rgba[geom])
    if number >= 0 and np.allclose(rgba, _DEFAULT_RGBA):
        return tuple(float(v) for v in model.mat_rgba[number])
    return rgba


def texture_image(model: mujoco.MjModel, number: int) -> NDArray[np.uint8]:
    """[height, width, channels], row 0 on top."""
    height, width, channels = (int(a[number]) for a in (model.tex_height, model.tex_width, model.tex_nchannel))
    data = model.tex_data[model.tex_adr[number] :][: height * width * channels]
    return np.ascontiguousarray(data.reshape(height, width, channels))


def ambient_radiance(model: mujoco.MjModel) -> tuple[float, float, float]:
    """Uniform radiance from all sides: MuJoCo's ambient terms and its headlight, which is no light of the room."""
    head = model.vis.headlight
    total = (np.asarray(head.ambient) + np.asarray(head.diffuse)) * bool(head.active) + np.zeros(3)
    for light in range(model.nlight):
        total += model.light_ambient[light] * bool(model.light_active[light])
    red, green, blue = (float(v) for v in total)
    return red, green, blue


def light(model: mujoco.MjModel, data: mujoco.MjData, number: int, environment: int | None) -> kuafu.Light | None:
    """One of the model's lights, posed by the state; None if it is off or gives no diffuse light."""
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
