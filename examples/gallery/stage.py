# SPDX-License-Identifier: Apache-2.0
"""One small scene per picture: a ball on a checkered table before a wall, and what a tile changes about it."""

import kuafu
import numpy as np
from shapes import at, ball, box, checker, look_at, quad, sky

WIDTH, HEIGHT = 208, 156
SAMPLES = 24  # per pixel; gallery.py sets it
GREY = {"base_color": (0.55, 0.55, 0.55, 1), "specular": 0.0}
# The map's frame is x right, y down, z forward; the world's z is up.
MAP_TO_WORLD = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]


class Stage:
    """A scene and what to render of it; tiles change the fields before `render`."""

    def __init__(self, device, *, wall=True):
        self.scene = kuafu.Scene(device)
        self.renderer = kuafu.Renderer(device)
        self.camera = {"eye": (0.0, -3.2, 1.3), "target": (0.0, 0.0, 0.42), "focal": 260.0}
        self.camera_fields = {}
        self.options = {"band": "visible", "spp": SAMPLES, "max_bounces": 8, "seed": 1, "denoise": "atrous"}
        self.exposure = 1.0
        table = self.scene.add_material(
            kuafu.Material(specular=0.0, base_color_texture=self.texture(checker(), srgb=True))
        )
        self.add(quad((0, 1, 0), (4, 0, 0), (0, 4, 0), repeat=2.5), table)
        if wall:
            self.add(quad((0, 1.6, 1), (3, 0, 0), (0, 0, 2)), self.material(**GREY))

    def texture(self, texels, srgb=False):
        return self.scene.add_texture(np.ascontiguousarray(texels), srgb=srgb)

    def material(self, **fields):
        return self.scene.add_material(kuafu.Material(**fields))

    def add(self, shape, material, pose=None, **fields):
        """A mesh of its own, placed once; returns (mesh, instance)."""
        positions, faces, normals, uvs = shape
        mesh = self.scene.add_mesh(positions, faces, normals=normals, uvs=uvs)
        return mesh, self.scene.add_instance(mesh, [material], local_to_world=pose, **fields)

    def ball(self, x=0.0, y=0.0, radius=0.5, **material):
        return self.add(ball(radius), self.material(**(material or GREY)), at(x, y, radius))

    def boxes(self):
        """Things with edges, for shadows and depth."""
        for x, y, half, yaw in ((-0.85, 0.5, 0.3, 0.5), (0.9, 0.7, 0.42, -0.3)):
            self.add(
                box((half, half, half)), self.material(base_color=(0.6, 0.3, 0.2, 1), specular=0.0), at(x, y, half, yaw)
            )

    def light(self, kind, eye, target=(0, 0, 0.4), **fields):
        return self.scene.add_light(kuafu.Light(kind=kind, light_to_world=look_at(eye, target), **fields))

    def daylight(self, strength=1.0):
        """A sky, and a large lamp for soft shadows."""
        self.scene.set_environment((strength,) * 3, strength, texture=self.texture(sky()), map_to_world=MAP_TO_WORLD)
        self.light(
            "rectangle", (-2.0, -1.5, 3.0), intensity=(5 * strength,) * 3, ir_intensity=5 * strength, size_m=(1.2, 1.2)
        )

    def view(self):
        f = self.camera["focal"]
        k = [[f, 0, (WIDTH - 1) / 2], [0, f, (HEIGHT - 1) / 2], [0, 0, 1]]
        return kuafu.Camera(WIDTH, HEIGHT, k, look_at(self.camera["eye"], self.camera["target"]), **self.camera_fields)

    def render(self, output="radiance"):
        """[height, width, channels] of one output."""
        return self.renderer.render(self.scene, self.view(), [output], **self.options)[output][0]

    def picture(self):
        """uint8 RGB: radiance times the exposure, as sRGB."""
        return to_srgb(self.exposure * self.render())


def to_srgb(linear):
    linear = np.clip(np.repeat(linear, 3, -1) if linear.shape[-1] == 1 else linear, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255 * encoded).astype(np.uint8)
