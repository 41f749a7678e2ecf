# SPDX-License-Identifier: Apache-2.0
"""Captures of a flat wall under the D435's pattern, rendered by kuafu, whose dots are known."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import kuafu
from activestereo import StereoDepthSensorConfig
from activestereo.camera.plan import pattern_k
from activestereo.common.pose import rigid_motion
from activestereo.scene_io import meshes
from activestereo.capture.capture import Camera, Capture, Frame, Projector, Rig
from activestereo.capture.write import write_capture
from activestereo.common.pattern import dots, make_pattern

BASELINE_M, BLACK_DN, READ_DN, GAIN_DN_PER_E = 0.05, 5.0, 0.4, 0.02
# Where the projector really stands in the left camera's frame, and where the rig believes that it does.
POSITION_M, NOMINAL_POSITION_M = np.array([0.0293, 0.0004, -0.0012]), np.array([0.029, 0.0, 0.0])


@dataclass(frozen=True)
class WallWorld:
    """config: the sensor; walls: (distance in metres, yaw in radians) of each."""

    config: StereoDepthSensorConfig
    walls: tuple[tuple[float, float], ...]

    @classmethod
    def make(cls, walls: tuple[tuple[float, float], ...], scale: float = 1.0) -> "WallWorld":
        config = StereoDepthSensorConfig("sapien-D435")
        return cls(config if scale == 1.0 else config.scaled(scale), walls)

    @property
    def projector_K(self) -> np.ndarray:
        return pattern_k(self.config, self.config.pattern_design.width, self.config.pattern_design.height)

    def true_dots(self) -> np.ndarray:
        """[n][3]: u, v and peak."""
        return np.column_stack(dots(self.config.pattern_design))

    def wall_pose(self, wall: tuple[float, float]) -> np.ndarray:
        """The wall's local_to_world: its front is local z = 0, seen along +z."""
        distance, yaw = wall
        return rigid_motion((0, 0, distance), Rotation.from_euler("y", yaw).as_matrix())

    def render(
        self, device: kuafu.Device, wall: tuple[float, float], light: kuafu.Light, scene: kuafu.Scene, spp: int = 32
    ) -> np.ndarray:
        """Radiance [2][height][width] of both cameras."""
        width, height = self.config.ir_resolution
        poses = np.eye(4), rigid_motion((BASELINE_M, 0, 0))
        cameras = [kuafu.Camera(width, height, self.config.ir_intrinsic, pose) for pose in poses]
        scene.add_light(light)
        out = kuafu.Renderer(device).render(
            scene, cameras, ("radiance",), band="infrared", spp=spp, max_bounces=0, ir_ambient_radiance=0.01
        )
        return out["radiance"][..., 0].astype(np.float64)

    def scene(self, device: kuafu.Device, wall: tuple[float, float]) -> kuafu.Scene:
        scene = kuafu.Scene(device)
        box = meshes.box(12, 12, 0.02)
        mesh = scene.add_mesh(box.positions, box.indices.reshape(-1, 3), normals=box.normals)
        grey = {"name": "wall", "base_color": (0.6, 0.6, 0.6, 1), "ir_albedo": 0.6}
        matt = scene.add_material(kuafu.Material(metallic=0, roughness=1, specular=0, **grey))
        scene.add_instance(mesh, [matt], local_to_world=self.wall_pose(wall) @ rigid_motion((0, -6, 0.01)))
        return scene

    def textured(self, scene: kuafu.Scene) -> kuafu.Light:
        """The projector at its true place with the pattern as an image."""
        pose = rigid_motion(POSITION_M)
        texture = scene.add_texture(make_pattern(self.config.pattern_design))
        return kuafu.Light(kind="projector", ir_intensity=3.0, texture=texture, k=self.projector_K, light_to_world=pose)

    def write(
        self, folder: Path, device: kuafu.Device, repeats: int = 20, spp: int = 32, seed: int = 0,
        brightest_dn: float = 190.0,
    ) -> Capture:  # fmt: skip
        """Writes a capture of the walls, a repeat group each; the first one's brightest dots are at brightest_dn."""
        rng = np.random.default_rng(seed)
        images, frames = {}, []
        gain = None
        for group, wall in enumerate(self.walls):
            scene = self.scene(device, wall)
            expected = self.render(device, wall, self.textured(scene), scene, spp)
            gain = gain or brightest_dn / np.quantile(expected, 0.9995)
            expected *= gain
            for _ in range(repeats):
                number = len(frames)
                for side, image in zip(("left", "right"), expected, strict=True):
                    images[number, side] = exposed(image, rng)
                path = Path("unwritten")
                exposure_s = 0.008 + 1e-7 * number  # a camera's metadata jitters
                frames.append(
                    Frame(number, path, path, 0.033 * number, exposure_s, np.eye(4), "train", repeat_group=group)
                )
        width, height = self.config.ir_resolution
        camera = Camera(width, height, self.config.ir_intrinsic)
        left_to_right, left_to_projector = rigid_motion((-BASELINE_M, 0, 0)), rigid_motion(-NOMINAL_POSITION_M)
        scene_file = folder.with_name(folder.name + "-scene.gltf")
        scene_file.write_text('{"asset": {"version": "2.0"}, "scenes": [{"nodes": []}], "scene": 0}')
        projector = Projector(Path("pattern.png"), self.projector_K, left_to_projector)
        capture = Capture(folder, folder.name, scene_file, Rig(camera, camera, left_to_right, projector), tuple(frames))
        write_capture(folder, capture, images, make_pattern(self.config.pattern_design))
        return capture


def exposed(light_dn: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One noisy 8-bit frame of an expected image above black."""
    electrons = rng.poisson(np.maximum(light_dn, 0.0) / GAIN_DN_PER_E)
    counts = np.rint(electrons * GAIN_DN_PER_E + BLACK_DN + rng.normal(0.0, READ_DN, light_dn.shape))
    return counts.clip(0, 255).astype(np.uint8)


def seen_dots(
    world: WallWorld, wall: tuple[float, float], side: str, border_px: float = 5.0
) -> tuple[np.ndarray, np.ndarray]:
    """(true dots' numbers, their pixels [n][2]) of those inside a camera's image."""
    true, K, P = world.true_dots(), world.config.ir_intrinsic, world.projector_K
    ray = np.column_stack([(true[:, 0] - P[0, 2]) / P[0, 0], (true[:, 1] - P[1, 2]) / P[1, 1], np.ones(len(true))])
    pose = world.wall_pose(wall)
    normal = pose[:3, 2]
    reach = ((pose[:3, 3] - POSITION_M) @ normal) / (ray @ normal)
    points = POSITION_M + reach[:, None] * ray
    points[:, 0] -= BASELINE_M if side == "right" else 0.0
    u, v = (K[i, i] * points[:, i] / points[:, 2] + K[i, 2] for i in (0, 1))
    width, height = world.config.ir_resolution
    inside = (reach > 0) & (u > border_px) & (u < width - 1 - border_px)
    numbers = np.flatnonzero(inside & (v > border_px) & (v < height - 1 - border_px))
    return numbers, np.column_stack([u, v])[numbers]
