# SPDX-License-Identifier: Apache-2.0
"""A world that stands for reality, rendered by Mitsuba 3 with its own material models. The simulation does not know the
differences:

| what | simulation | here |
|--|--|--|
| renderer | kuafu, `samples` rays, denoised | Mitsuba 3's path tracer, not denoised |
| matcher | simsense | OpenCV's StereoSGBM, all paths |
| noise | the preset's, of a D435 | shot noise of 15 000 electrons at full scale, 10 electrons of read noise |
| speckle | gamma, of 8 %, with grain | lognormal, of 10 %, without grain |
| exposure | whole image to 68 counts | its middle to 80 counts |
| optics | the preset's blur and vignetting | 0.5 px of blur, cos^4 vignetting |
| dots | the preset's pattern | of another draw, a tenth wider, 15 % of the light missing, no fall-off |
| calibration | exact | right camera turned by 0.02 degrees |
| gloss | GGX, roughness as the data | Beckmann, rougher by 0.05; smooth lacquer |
| metals | a reflectance | indices of chromium and, tarnished, of copper |
| glass | refracting body | thin: Fresnel's reflection on each face, no refraction |
| albedos | as the data | 0.7 to 0.9 of them |
| room | a point lamp | a ball of 8 cm, another place, brighter, another table |
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from sim_to_real.mitsuba_camera import MitsubaCamera
from sim_to_real.mitsuba_scene import grey, mesh, mitsuba, use_one_thread
from sim_to_real.objects import BenchmarkObject
from sim_to_real.sgbm import Sgbm
from sim_to_real.stage import CameraSettings, crop
from sim_to_real.views import View
from activestereo.common.pose import body_pose
from activestereo.scene_io.meshes import Mesh, box

_AMBIENT, _TABLE_ALBEDO = 0.3, 0.35
_LAMP_M, _LAMP_RADIUS_M, _LAMP_W_PER_SR = (-0.6, 0.5, 1.0), 0.04, 1.6
_TABLE_HALF_M = 1.0
_GLASS_IOR = 1.5


class MitsubaStage:
    """depth [objects, height, width] metres of rounds of views. samples: of MitsubaCamera."""

    def __init__(self, objects: tuple[BenchmarkObject, ...], settings: CameraSettings, samples: int = 64) -> None:
        use_one_thread()
        self.config = crop(settings)
        self._objects, self._camera, self._matcher = objects, MitsubaCamera(self.config, samples), Sgbm(self.config)

    def take_depth(self, views: list[View], seed: int) -> NDArray[np.float32]:
        """0 = no measurement. Everything drawn at random depends on `seed` alone."""
        depths = []
        for number, view in enumerate(views):
            random = np.random.default_rng([seed, number])
            depths.append(self._matcher.depth(*self.pair(view, random)))
        return np.stack(depths)

    def pair(self, view: View, random: np.random.Generator) -> list[NDArray[np.uint8]]:
        """Counts of the left and the right camera."""
        thing = self._objects[view.object_index]
        at = view.object_to_world, view.camera_to_world[:3, 3]
        parts = foreign_things(thing.mesh, thing.material, view.object_index, *at)
        light = self._camera.light(parts, foreign_room(), body_pose(view.camera_to_world), random)
        return self._camera.counts(light, random)


def foreign_things(
    shape: Mesh,
    material: kuafu.Material,
    index: int,
    object_to_world: NDArray[np.float64],
    camera_m: NDArray[np.float64],
) -> dict[str, Any]:
    """Parts of a scene: the table with its top at z = 0, and object number `index`. camera_m: in the world's axes."""
    mi = mitsuba()
    bsdf, vertex = foreign_bsdf(shape, material, index, (np.linalg.inv(object_to_world) @ [*camera_m, 1.0])[:3])
    upright = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, -0.02], [0, 0, 0, 1]])
    slab = box(2 * _TABLE_HALF_M, 0.02, 2 * _TABLE_HALF_M)
    table = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": grey(_TABLE_ALBEDO)}}
    return {"table": mesh(mi, slab, table, upright), "thing": mesh(mi, shape, bsdf, object_to_world, **vertex)}


def foreign_room() -> dict[str, Any]:
    """The lights besides the projector."""
    radiance = _LAMP_W_PER_SR / (np.pi * _LAMP_RADIUS_M**2)
    lamp = {"type": "area", "radiance": grey(radiance)}
    return {
        "sky": {"type": "constant", "radiance": grey(_AMBIENT)},
        "lamp": {"type": "sphere", "center": list(_LAMP_M), "radius": _LAMP_RADIUS_M, "emitter": lamp},
    }


def foreign_bsdf(
    shape: Mesh, told: kuafu.Material, index: int, camera_m: NDArray[np.float64]
) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """(surface of object number `index`, values at the mesh's corners that it asks for); camera_m: the camera's place
    in the object's frame."""
    infrared = told.base_color[0] if told.ir_albedo is None else told.ir_albedo
    albedo = (0.7 + 0.1 * (index % 3)) * float(infrared)
    gloss: dict[str, Any] = {"distribution": "beckmann", "alpha": (told.roughness + 0.05) ** 2}
    if told.transmission:
        mirror = {"type": "conductor", "material": "none"}
        opacity = {"type": "mesh_attribute", "name": "vertex_opacity"}
        return {"type": "mask", "opacity": opacity, "bsdf": mirror}, {"opacity": _reflected(shape, camera_m)}
    if told.metallic:
        metal = ("Cr", 1.0) if told.base_color[0] < 0.7 else ("Cu", 0.9)
        tarnish = {"material": metal[0], "specular_reflectance": grey(metal[1])}
        bsdf: dict[str, Any] = {"type": "roughconductor", **gloss, **tarnish}
    elif told.specular == 0.0:
        bsdf = {"type": "diffuse", "reflectance": grey(albedo)}
    else:
        coat = {"type": "plastic"} if told.roughness < 0.1 else {"type": "roughplastic", **gloss}
        bsdf = {**coat, "diffuse_reflectance": grey(albedo), "nonlinear": True}
    return {"type": "twosided", "bsdf": bsdf}, {}


def _reflected(shape: Mesh, camera_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """[corners] glass' reflectance towards the camera: Fresnel's equations for unpolarised light. Mitsuba's path tracer
    finds no light through refracting glass, so this glass does not refract."""
    way = camera_m - shape.positions
    cosine = np.abs(np.einsum("ij,ij->i", way, shape.normals)) / np.linalg.norm(way, axis=1)
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / _GLASS_IOR**2)
    across = (cosine - _GLASS_IOR * inside) / (cosine + _GLASS_IOR * inside)
    along = (_GLASS_IOR * cosine - inside) / (_GLASS_IOR * cosine + inside)
    return np.asarray(0.5 * (across**2 + along**2))
