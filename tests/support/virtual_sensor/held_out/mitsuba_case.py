# SPDX-License-Identifier: Apache-2.0
"""Makes test cases whose light Mitsuba 3 (Jakob et al., 2022) renders, with its shapes, its projector and its paths.

Lens, imager and bent rays stay the virtual sensor's. Direct projector light has no noise, because it is one path a ray.
Light that surfaces send on is smoothed over each surface, albedo left out. Rolling shutters, defocus, haze and light
below or through surfaces are not rendered.
"""

from types import SimpleNamespace

import numpy as np
from mitsuba_scene import bitmap, grey, mesh, projector
from scipy.ndimage import gaussian_filter

from virtual_sensor.cylinder import Cylinder
from virtual_sensor.held_out import camera
from virtual_sensor.held_out.case import HEIGHT, WIDTH, Case
from virtual_sensor.held_out.caster import albedo_of, closest
from virtual_sensor.held_out.rig import PATTERN_HEIGHT, PATTERN_WIDTH
from virtual_sensor.held_out.surface import LAMP_POSITION, Layers, depth_along, second_unit_poses
from virtual_sensor.solids import Box, Sphere
from virtual_sensor.tiles import Tiles

# Hidden effects whose light Mitsuba renders; effects of lenses, imagers and noise only need its images.
NOT_RENDERED = frozenset(
    "projector_defocus dot_astigmatism rolling_shutter exposure_desync row_desync motion_blur haze subsurface"
    " transmission interreflection dim_dots".split()
)
_FINE = 2  # texels of the projector's image per pixel of the pattern
_PATHS, _MOST_SURFACES = 4, 6  # paths per ray of the subpixel grid, most surfaces of a path
_SMOOTH_PX = 1.5


def mitsuba():
    """Returns the package mitsuba in its LLVM variant. Raises ImportError without it."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    return mi


class MitsubaCase(Case):
    """A Case whose light Mitsuba renders."""

    def _indirect(self, hardware, frame):
        return None, None  # Mitsuba's paths bounce by themselves.

    def _cast(self, hardware, frame, side, sub, dt_s, offset, bounced, ambient):
        if unseen := NOT_RENDERED & set(hardware.hidden):
            raise ValueError(f"Mitsuba's worlds have no {', '.join(sorted(unseen))}")
        mi = mitsuba()
        bundle = camera.rays(self.rig, frame, side, hardware.hidden, sub, dt_s, offset)
        surfaces = Surfaces(self.solids, bundle, (HEIGHT * sub, WIDTH * sub))
        things = _things(mi, hardware)
        seed = int(np.random.SeedSequence([self.seed, frame.id, side == "right"]).generate_state(1)[0])
        rays = _Rays(mi, bundle, seed)
        lit = things | {"laser": _laser(mi, hardware, frame)}
        straight, every = rays.light(lit, 2, 1), rays.light(lit, _MOST_SURFACES, _PATHS)
        sky = rays.light(things | {"sky": {"type": "constant"}}, _MOST_SURFACES, _PATHS)
        other = lamp = np.zeros_like(straight)
        if "second_projector" in hardware.hidden:
            other = rays.light(things | {"laser": _second(mi, hardware, frame)}, 2, 1)
        if "ambient_ir" in hardware.hidden:
            strength = np.pi * hardware.hidden["ambient_ir"]["strength"]
            point = {"type": "point", "position": list(LAMP_POSITION), "intensity": grey(strength)}
            lamp = rays.light(things | {"lamp": point}, 2, 1)
        lights = (straight, surfaces.smooth(every - straight), surfaces.smooth(sky), other, lamp)
        return Layers(*(light.reshape(surfaces.shape) for light in lights), surfaces.depth)


class Surfaces:
    """The surfaces that the rays of a subpixel grid hit, for smoothing light over each of them."""

    def __init__(self, solids, bundle, shape):
        origins, directions, *_ = bundle
        self.shape = shape
        t, normal, self._index = closest(solids, origins, directions)
        hit = self._index >= 0
        points = origins + np.where(hit, t, 0.0)[:, None] * directions
        self._albedo = albedo_of(solids, self._index, points)
        self.depth = depth_along(bundle, t, self._index).reshape(shape)
        faces = np.rint(3.0 * normal).astype(int) @ [100, 10, 1]  # a box's faces; patches of a rounded solid
        boxes = np.isin(self._index, [i for i, solid in enumerate(solids) if isinstance(solid, Box)])
        self._parts = 10_000 * self._index + np.where(boxes, faces, 0)

    def smooth(self, light):
        """Averages irradiance over neighbours on a surface. Returns the flat radiances; the sky stays."""
        out = light.copy()
        irradiance = light / np.maximum(self._albedo, 1e-3)
        sigma = _SMOOTH_PX * self.shape[0] / HEIGHT
        for part in np.unique(self._parts[self._index >= 0]):
            here = (self._parts == part) & (self._index >= 0)
            weight = gaussian_filter(here.astype(float).reshape(self.shape), sigma, truncate=2.5).ravel()
            total = gaussian_filter(np.where(here, irradiance, 0.0).reshape(self.shape), sigma, truncate=2.5).ravel()
            out[here] = (self._albedo * total / np.maximum(weight, 1e-12))[here]
        return out


class _Rays:
    def __init__(self, mi, bundle, seed):
        self._mi, self._seed, self._count = mi, seed, len(bundle[1])
        self._rays = [mi.Point3f(*np.ascontiguousarray(part.T, np.float32)) for part in bundle[:2]]

    def light(self, parts, surfaces, paths):
        """Returns the mean radiance along rays over `paths` paths. surfaces: a path's most vertices."""
        mi = self._mi
        scene = mi.load_dict({"type": "scene", **parts})
        integrator = mi.load_dict({"type": "path", "max_depth": surfaces, "rr_depth": 100})
        total = np.zeros(self._count)
        for k in range(paths):
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed((self._seed + k) % 2**32, self._count)
            rays = mi.RayDifferential3f(self._rays[0], mi.Vector3f(self._rays[1]))
            found = integrator.sample(scene, sampler, rays)[0]
            total += np.array(found)[0]
        return total / paths


def _things(mi, hardware):
    return {solid.name: _shape(mi, solid, _paint(mi, hardware, solid)) for solid in hardware.solids}


def _paint(mi, hardware, solid):
    albedo = bitmap(mi, np.asarray(solid.albedo), "nearest") if isinstance(solid, Tiles) else grey(solid.albedo)
    bsdf = {"type": "diffuse", "reflectance": albedo}
    if "specular" in hardware.hidden and hardware.is_glossy(solid):
        p = hardware.hidden["specular"]
        bsdf = {
            "type": "principled", "base_color": albedo, "specular": min(1.0, p["f0"] / 0.08),
            "roughness": float(p["roughness"]),
        }  # fmt: skip
    return {"type": "twosided", "side": bsdf}


def _shape(mi, solid, paint):
    transform = mi.ScalarTransform4f
    if isinstance(solid, Sphere):
        return {"type": "sphere", "center": list(solid.centre), "radius": solid.radius, "bsdf": paint}
    frame = np.eye(4)
    frame[:3, 3] = solid.centre
    if isinstance(solid, Box):
        frame[:3, :3] = solid.rotation() * np.asarray(solid.half_size)
        return {"type": "cube", "to_world": transform(frame.tolist()), "bsdf": paint}
    if isinstance(solid, Cylinder):
        positions, normals, faces = solid.triangles()  # Mitsuba's cylinder is an open tube
        return mesh(mi, SimpleNamespace(positions=positions, normals=normals, indices=faces), paint, np.eye(4))
    # A rectangle's u runs along its first edge; an image's columns lie along u, a Tiles' rows along its u.
    u, v = np.asarray(solid.v), np.asarray(solid.u)
    frame[:3, :3] = np.stack([u, v, np.cross(u, v) / np.linalg.norm(np.cross(u, v))], axis=1)
    return {"type": "rectangle", "to_world": transform(frame.tolist()), "bsdf": paint}


def _laser(mi, hardware, frame):
    pose = frame.camera_to_world.copy()
    pose[:3, 3] += hardware.rig.projector_x_m * pose[:3, 0]
    return _projector(mi, hardware, frame, pose, 1.0)


def _second(mi, hardware, frame):
    place = dict(hardware.hidden["second_projector"])
    power = place.pop("power")
    [pose] = second_unit_poses(hardware.rig, frame.camera_to_world[None], **place)
    return _projector(mi, hardware, frame, pose, power)


def _projector(mi, hardware, frame, pose, power):
    width, height = _FINE * PATTERN_WIDTH, _FINE * PATTERN_HEIGHT
    focal, cx, cy = _FINE * hardware.emitter.K[0, 0], 0.5 * (width - 1), 0.5 * (height - 1)
    x, y = np.meshgrid((np.arange(width) - cx) / focal, (np.arange(height) - cy) / focal)
    ways = np.stack([x, y, np.ones_like(x)], axis=-1)
    intensity = hardware.emitter.intensity(ways.reshape(-1, 3), frame).reshape(x.shape)
    return projector(mi, intensity, np.array([[focal, 0, cx], [0, focal, cy], [0, 0, 1]]), power, pose)
