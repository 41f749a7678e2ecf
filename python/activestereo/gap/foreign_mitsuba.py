# SPDX-License-Identifier: Apache-2.0
"""A world that stands for reality, rendered by another project, Mitsuba 3, with materials of that project's laws. No
mode is told how it differs:

| what | simulation | here |
|--|--|--|
| renderer | kuafu, `samples` rays, denoised | Mitsuba 3's path tracer, not denoised |
| matcher | simsense | OpenCV's StereoSGBM, all paths |
| noise | the preset's, of a D435 | shot noise of 15 000 electrons at full scale, 10 electrons of read noise |
| speckle | gamma, of 8 %, with grain | lognormal, of 10 %, without grain |
| exposure | whole image to 68 counts | its middle to 80 counts |
| optics | the preset's blur and vignetting | 0.5 px of blur, cos^4 vignetting |
| dots | the preset's pattern | of another draw, a tenth wider, 15 % of the light missing, no fall-off |
| calibration | exact | right eye turned by 0.02 degrees |
| gloss | GGX, roughness as the data | Beckmann, rougher by 0.05; smooth lacquer |
| metals | a reflectance | indices of chromium and, tarnished, of copper |
| glass | refracting body | thin: Fresnel's reflection on each face, no refraction |
| albedos | as the data | 0.7 to 0.9 of them |
| room | a point lamp | a ball of 8 cm, another place, brighter, another table |
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.gap.mitsuba_scene import grey, mesh, mitsuba, pose, projector, use_one_thread
from activestereo.gap.objects import GapObject
from activestereo.gap.sgbm import Sgbm
from activestereo.gap.stage import CameraSettings, crop
from activestereo.gap.views import View, rotation
from activestereo.meshes import box
from activestereo.pattern import PatternDesign, make_pattern
from activestereo.pose import body_pose, camera_to_world

_AMBIENT, _TABLE_ALBEDO = 0.3, 0.35
_LAMP_M, _LAMP_RADIUS_M, _LAMP_W_PER_SR = (-0.6, 0.5, 1.0), 0.04, 1.6
_TABLE_HALF_M = 1.0
_MOST_DEPTH = 8  # surfaces of a path, the light's and the camera's included
_RIGHT_TURN_RAD = np.deg2rad([0.02, 0.0, 0.0])  # about the row: what rectification did not know
_LASER_SHARE, _DOT_WIDTH, _PATTERN_SEED = 0.85, 1.1, 77
_SPECKLE = 0.1
_NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.uint8)
_SHARPEST, _BLUR_PX = 3.0, 0.5
_FULL_WELL_E, _READ_E, _TARGET_DN = 15_000.0, 10.0, 80.0
_GLASS_IOR = 1.5


class MitsubaStage:
    """depth [objects, height, width] metres of rounds of views. samples: rays per pixel of the projector's light, and
    as many of the room's; 64 leave a fifth of the camera's own noise on what is matt. ValueError without Mitsuba."""

    def __init__(self, objects: tuple[GapObject, ...], settings: CameraSettings, samples: int = 64) -> None:
        self._mi, self._objects, self._samples = mitsuba(), objects, samples
        use_one_thread()
        self.config = crop(settings)
        self._matcher = Sgbm(self.config)
        design = self.config.pattern_design
        own = {"seed": design.seed + _PATTERN_SEED, "dot_sigma_px": _DOT_WIDTH * design.dot_sigma_px}
        pattern = make_pattern(PatternDesign(**{**vars(design), **own}))
        self._pattern = pattern / 255.0
        self._pattern_k = self.config.pattern_k(design.width, design.height)

    def take(self, views: list[View], seed: int) -> NDArray[np.float32]:
        """0 = no measurement. Everything drawn at random depends on `seed` alone."""
        depths = []
        for number, view in enumerate(views):
            random = np.random.default_rng([seed, number])
            depths.append(self._matcher.depth(*self.pair(view, random)))
        return np.stack(depths)

    def pair(self, view: View, random: np.random.Generator) -> list[NDArray[np.uint8]]:
        """Counts of the left and the right eye."""
        return self._counts(self._light(view, random), random)

    def repeats(self, view: View, count: int, random: np.random.Generator) -> list[NDArray[np.uint8]]:
        """[count, height, width] of the left and the right eye, of a view where nothing moves."""
        light = self._light(view, random)
        pairs = [self._counts(light, random) for _ in range(count)]
        return [np.stack(eye) for eye in zip(*pairs, strict=True)]

    def _light(self, view: View, random: np.random.Generator) -> list[NDArray[np.float64]]:
        seeds = iter(random.integers(2**31, size=4).tolist())
        body = body_pose(view.camera_to_world)
        config, things = self.config, self._things(view)
        laser = projector(
            self._mi,
            self._pattern,
            self._pattern_k,
            _LASER_SHARE * config.projector_intensity,
            camera_to_world(body * config.pose_rgb_irproj),
        )
        right_turn = np.eye(4)
        right_turn[:3, :3] = rotation(_RIGHT_TURN_RAD)
        eyes = (config.trans_pose_l, np.eye(4)), (config.trans_pose_r, right_turn)
        light = []
        for place, turn in eyes:
            sensor = self._sensor(camera_to_world(body * place) @ turn)
            dots, room = (self._render(things | part, sensor, next(seeds)) for part in ({"laser": laser}, _room()))
            light.append(dots * random.lognormal(-0.5 * _SPECKLE**2, _SPECKLE, dots.shape) + room)
        return light

    def _counts(self, light: list[NDArray[np.float64]], random: np.random.Generator) -> list[NDArray[np.uint8]]:
        height, width = light[0].shape
        x = (np.arange(width) - 0.5 * (width - 1)) / self.config.ir_intrinsic[0, 0]
        y = (np.arange(height) - 0.5 * (height - 1)) / self.config.ir_intrinsic[1, 1]
        lens = 1.0 / (1.0 + x[None] ** 2 + y[:, None] ** 2) ** 2
        middle = slice(height // 4, -(height // 4)), slice(width // 4, -(width // 4))
        electrons_per_dn = _FULL_WELL_E / 255.0
        scale = _TARGET_DN * electrons_per_dn / np.mean([(lens * image)[middle] for image in light])
        electrons = [random.poisson(scale * lens * image) + random.normal(0.0, _READ_E, lens.shape) for image in light]
        return [np.clip(np.rint(own / electrons_per_dn), 0, 255).astype(np.uint8) for own in electrons]

    def _render(self, parts: dict[str, Any], sensor: dict[str, Any], seed: int) -> NDArray[np.float64]:
        integrator = {"type": "volpath", "max_depth": _MOST_DEPTH, "rr_depth": 100}
        scene = self._mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, **parts})
        image = np.array(self._mi.render(scene, spp=self._samples, seed=seed), np.float64)[..., :3].mean(axis=-1)
        # A path that meets a lamp by way of metal is rare and bright: a single pixel that no lens would draw so sharp.
        brightest = cv2.dilate(image, _NEIGHBOURS)
        return np.asarray(cv2.GaussianBlur(np.minimum(image, _SHARPEST * brightest), (0, 0), _BLUR_PX))

    def _sensor(self, to_world: NDArray[np.float64]) -> dict[str, Any]:
        width, height = self.config.ir_resolution
        return {
            "type": "perspective",
            "fov": float(np.rad2deg(2 * np.arctan(0.5 * width / self.config.ir_intrinsic[0, 0]))),
            "to_world": pose(self._mi, to_world),
            "near_clip": 1e-3,
            "sampler": {"type": "multijitter", "sample_count": self._samples},
            "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
        }

    def _things(self, view: View) -> dict[str, Any]:
        thing = self._objects[view.object_index]
        camera_to_object = np.linalg.inv(view.object_to_world) @ view.camera_to_world
        bsdf, vertex = foreign_bsdf(thing, view.object_index, camera_to_object[:3, 3])
        upright = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, -0.02], [0, 0, 0, 1]])
        slab = box(2 * _TABLE_HALF_M, 0.02, 2 * _TABLE_HALF_M)
        table = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": grey(_TABLE_ALBEDO)}}
        return {
            "table": mesh(self._mi, slab, table, upright),
            "thing": mesh(self._mi, thing.mesh, bsdf, view.object_to_world, **vertex),
        }


def foreign_bsdf(
    thing: GapObject, index: int, camera_m: NDArray[np.float64]
) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """(surface of object number `index`, values at the mesh's corners that it asks for); camera_m: the camera's place
    in the object's frame."""
    told = thing.material
    albedo = (0.7 + 0.1 * (index % 3)) * float(told.base_color[0])
    gloss: dict[str, Any] = {"distribution": "beckmann", "alpha": (told.roughness + 0.05) ** 2}
    if told.transmission:
        mirror = {"type": "conductor", "material": "none"}
        opacity = {"type": "mesh_attribute", "name": "vertex_opacity"}
        return {"type": "mask", "opacity": opacity, "bsdf": mirror}, {"opacity": _reflected(thing, camera_m)}
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


def _room() -> dict[str, Any]:
    radiance = _LAMP_W_PER_SR / (np.pi * _LAMP_RADIUS_M**2)
    lamp = {"type": "area", "radiance": grey(radiance)}
    return {
        "sky": {"type": "constant", "radiance": grey(_AMBIENT)},
        "lamp": {"type": "sphere", "center": list(_LAMP_M), "radius": _LAMP_RADIUS_M, "emitter": lamp},
    }


def _reflected(thing: GapObject, camera_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """[corners] what a face of glass reflects of light from where the camera is: Fresnel's equations, not polarised.
    Their path tracer finds no light through glass that bends it, so this glass does not."""
    way = camera_m - thing.mesh.positions
    cosine = np.abs(np.einsum("ij,ij->i", way, thing.mesh.normals)) / np.linalg.norm(way, axis=1)
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / _GLASS_IOR**2)
    across = (cosine - _GLASS_IOR * inside) / (cosine + _GLASS_IOR * inside)
    along = (_GLASS_IOR * cosine - inside) / (_GLASS_IOR * cosine + inside)
    return np.asarray(0.5 * (across**2 + along**2))
