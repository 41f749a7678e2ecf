# SPDX-License-Identifier: Apache-2.0
"""One small scene per picture: a ball on a checkered table before a wall, and what a tile changes about it."""

from dataclasses import replace

import kuafu
import numpy as np
from activestereo.common import srgb
from activestereo.common.pose import look_at
from activestereo.scene_io import meshes, solids
from activestereo.scene_io.bodies import add_mesh
from shapes import at, checker, dots, sky

WIDTH, HEIGHT = 208, 156
SAMPLES = 24  # per pixel; gallery.py sets it
GREY = {"base_color": (0.55, 0.55, 0.55, 1), "specular": 0.0}
# The map's frame is x right, y down, z forward; the world's z is up.
MAP_TO_WORLD = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
UP = (0.0, 0.0, 1.0)


class Stage:
    """A scene and what to render of it; tiles change the fields before `render`."""

    def __init__(self, device, *, wall=True):
        self.scene = kuafu.Scene(device)
        self.renderer = kuafu.Renderer(device)
        self.camera = {"eye": (0.0, -3.2, 1.3), "target": (0.0, 0.0, 0.42), "focal": 260.0}
        self.camera_fields = {}
        self.options = {"band": "visible", "spp": SAMPLES, "max_bounces": 8, "seed": 1, "denoise": "atrous"}
        squares = self.texture(checker(20), srgb=True)
        table = meshes.sheet((-4, -3, 0), (8, 0, 0), (0, 8, 0))
        self.add(table, self.material(specular=0.0, base_color_texture=squares))
        if wall:
            self.add(meshes.sheet((-3, 1.6, -1), (6, 0, 0), (0, 0, 4)), self.material(**GREY))

    def texture(self, texels, srgb=False):
        return self.scene.add_texture(np.ascontiguousarray(texels), srgb=srgb)

    def material(self, **fields):
        return self.scene.add_material(kuafu.Material(**fields))

    def add(self, mesh, material, pose=None, **fields):
        """A mesh of its own, placed once; returns the instance."""
        return self.scene.add_instance(add_mesh(self.scene, mesh), [material], local_to_world=pose, **fields)

    def ball(self, x=0.0, y=0.0, radius=0.5, **material):
        unit = solids.sphere()
        mesh = replace(unit, positions=radius * unit.positions, uvs=unit.uvs * np.float32([2, 1]))
        return self.add(mesh, self.material(**(material or GREY)), at(x, y, radius))

    def boxes(self):
        """Things with edges, for shadows and depth."""
        for x, y, half, yaw in ((-0.85, 0.5, 0.3, 0.5), (0.9, 0.7, 0.42, -0.3)):
            paint = self.material(base_color=(0.6, 0.3, 0.2, 1), specular=0.0)
            self.add(solids.box(), paint, at(x, y, half, yaw, (half, half, half)))

    def things(self, **material):
        """The boxes, and a ball of this material before them."""
        self.boxes()
        self.ball(y=-0.2, radius=0.35, **material)

    def light(self, kind, eye, target=(0, 0, 0.4), **fields):
        return self.scene.add_light(kuafu.Light(kind=kind, light_to_world=look_at(eye, target, UP), **fields))

    def projector(self, eye=(0.25, -3.0, 1.2), target=(0, 0.3, 0.45), intensity=24.0, **fields):
        """A projector of dots, or of another pattern: `texture` or `dots`."""
        if not fields.keys() & {"texture", "dots"}:
            fields["texture"] = self.texture(dots())
        k = [[150, 0, 79.5], [0, 150, 79.5], [0, 0, 1]]
        return self.light("projector", eye, target, ir_intensity=intensity, k=k, **fields)

    def daylight(self):
        """A sky, and a large lamp for soft shadows."""
        self.scene.set_environment((1.0,) * 3, 1.0, texture=self.texture(sky()), map_to_world=MAP_TO_WORLD)
        self.light("rectangle", (-2.0, -1.5, 3.0), intensity=(5,) * 3, ir_intensity=5, size_m=(1.2, 1.2))

    def view(self):
        f = self.camera["focal"]
        k = [[f, 0, (WIDTH - 1) / 2], [0, f, (HEIGHT - 1) / 2], [0, 0, 1]]
        pose = look_at(self.camera["eye"], self.camera["target"], UP)
        return kuafu.Camera(WIDTH, HEIGHT, k, pose, **self.camera_fields)

    def render(self, *outputs):
        """[height, width, channels] of each output."""
        images = self.renderer.render(self.scene, self.view(), outputs, **self.options)
        return [images[name][0] for name in outputs]

    def picture(self):
        """uint8 RGB of the radiance, as sRGB."""
        return to_srgb(*self.render("radiance"))


def to_srgb(linear):
    linear = np.clip(np.repeat(linear, 3, -1) if linear.shape[-1] == 1 else linear, 0, 1)
    return np.round(255 * srgb.encoded(linear)).astype(np.uint8)
