# SPDX-License-Identifier: Apache-2.0
"""Writes what an afternoon with a D4xx on a robot's wrist leaves on the disk, rendered instead of recorded: so that the
page beside this file can be followed without a camera, and the truth is known.

    PYTHONPATH=build/python python3 examples/real_camera/practice_recording.py OUT [--samples 16] [--poses 5]

The camera is a D435 at 424x240 without distortion, whose projector stands 1.3 mm off its place; noise: shot and read.
OUT/truth.json says what the page's commands should find.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import kuafu
from activestereo import StereoDepthSensorConfig
from activestereo.camera.plan import pattern_of
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.capture.images import write_gray
from activestereo.common import srgb
from activestereo.common.output_files import write_json, write_png
from activestereo.common.pose import look_at, rigid_motion

WIDTH, HEIGHT, FOCAL_PX, BASELINE_M = 424, 240, 213.5, 0.05
K = np.array([[FOCAL_PX, 0, 211.7], [0, FOCAL_PX, 119.2], [0, 0, 1.0]])
COLOR_PLACE_M = 0.015  # the colour camera stands so far to the right
PROJECTOR_PLACE_M = (0.0293, 0.0004, -0.0012)
BLACK_DN, READ_DN, SHOT_DN = 5.0, 0.5, 0.02
BOX_M, BOX_ROUGHNESS, BOX_ALBEDO = (0.12, 0.09, 0.07), 0.35, 0.6
SQUARE_M, CORNERS = 0.03, (9, 6)
WALLS_M = {"near": 0.5, "far": 1.3}
WALL_EXPOSURE = 0.4  # of the desk's: the near wall's dots would be white
REPEATS = 12

TEXT = """\
Device info:
    Name                          : 	Intel RealSense D435 (practice)

{streams}
 Extrinsic from "Infrared 1"	  To	  "Infrared 2" :
 Rotation Matrix:
   1                0                0
   0                1                0
   0                0                1

 Translation Vector: {right}  0  0

 Extrinsic from "Infrared 1"	  To	  "Color" :
 Rotation Matrix:
   1                0                0
   0                1                0
   0                0                1

 Translation Vector: {color}  0  0
"""
STREAM = """\
 Intrinsic of "{name}" / {width}x{height} / {{Y8}}
  Width:      	{width}
  Height:     	{height}
  PPX:        	{cx}
  PPY:        	{cy}
  Fx:         	{f}
  Fy:         	{f}
  Distortion: 	Brown Conrady
  Coeffs:     	0  	0  	0  	0  	0

"""


def turned(vector: tuple[float, float, float], place: tuple[float, float, float]) -> NDArray[np.float64]:
    return rigid_motion(place, cv2.Rodrigues(np.array(vector))[0])


CAMERA_TO_GRIPPER = turned((0.1, -0.2, 1.5), (0.03, -0.05, 0.08))
BOX_TO_BASE = turned((0.0, 0.7, 0.0), (0.02, 0.0, 0.01))


class Practice:
    def __init__(self, out: Path, samples: int) -> None:
        self.out, self.samples = out, samples
        self.random = np.random.default_rng(5)
        self.device = kuafu.Device()
        self.renderer = kuafu.Renderer(self.device)
        pattern = pattern_of(StereoDepthSensorConfig("d435"))
        assert pattern is not None
        self.pattern, self.pattern_K = pattern

    def counts(self, light_dn: NDArray[np.floating]) -> NDArray[np.uint8]:
        noise = self.random.normal(size=light_dn.shape) * np.sqrt(READ_DN**2 + SHOT_DN * light_dn)
        return np.clip(np.rint(light_dn + BLACK_DN + noise), 0, 255).astype(np.uint8)

    def infrared(
        self, scene: kuafu.Scene, pose: NDArray[np.float64], on: bool, bounces: int, samples: int
    ) -> list[NDArray[np.float32]]:
        """Light of both cameras, DN above black."""
        light = None
        if on:
            texture = scene.add_texture(self.pattern)
            projector = kuafu.Light(kind="projector", ir_intensity=1.0, texture=texture, k=self.pattern_K)
            projector.light_to_world = pose @ rigid_motion(PROJECTOR_PLACE_M)
            light = scene.add_light(projector)
        right = pose @ rigid_motion((BASELINE_M, 0.0, 0.0))
        cameras = [kuafu.Camera(WIDTH, HEIGHT, K, p) for p in (pose, right)]
        seen = self.renderer.render(scene, cameras, ("radiance",), spp=samples, max_bounces=bounces)["radiance"]
        if light is not None:
            scene.remove_light(light)
        return [1000.0 * image[..., 0] for image in seen]

    # ---- what is recorded ----

    def write_calibration(self) -> None:
        streams = "".join(
            STREAM.format(name=name, width=WIDTH, height=HEIGHT, cx=K[0, 2], cy=K[1, 2], f=FOCAL_PX)
            for name in ("Infrared 1", "Infrared 2", "Color")
        )
        (self.out / "d435.txt").write_text(TEXT.format(streams=streams, right=-BASELINE_M, color=-COLOR_PLACE_M))

    def write_boards(self, count: int = 18) -> None:
        """A chessboard that stands still; the robot carries the camera around it."""
        board_to_base = turned((1.2, 0.3, -0.2), (0.4, 0.2, 0.1))
        across, down = CORNERS[0] + 1, CORNERS[1] + 1
        px, size_m = 40, (SQUARE_M * (across + 2), SQUARE_M * (down + 2))
        squares = np.pad(np.where(np.indices((down, across)).sum(axis=0) % 2, 200.0, 25.0), 1, constant_values=200.0)
        picture = np.kron(squares, np.ones((px, px))).astype(np.float32)
        rows = ["name,x,y,z,qx,qy,qz,qw"]
        number = 0
        while number < count:
            turn = np.deg2rad(self.random.uniform(-36, 36, 3)) * [1, 1, 1.5]
            distance = self.random.uniform(0.38, 0.62)
            place = distance * np.array([*(self.random.uniform(-0.55, 0.55, 2) * [1, 0.5]), 1.0])
            board_to_left = turned(tuple(turn), tuple(place))
            board_to_left[:3, 3] -= board_to_left[:3, :3] @ [0.5 * size_m[0], 0.5 * size_m[1], 0.0]
            images = [self._board_seen(picture, px, board_to_left, shift) for shift in (0.0, -BASELINE_M)]
            if any(image is None for image in images):
                continue
            name = f"{number:03d}.png"
            for side, image in zip(("left", "right"), images, strict=True):
                write_gray(_made(self.out / "boards" / side) / name, self.counts(image))
            rows.append(_csv_row(name, board_to_base @ np.linalg.inv(board_to_left) @ np.linalg.inv(CAMERA_TO_GRIPPER)))
            number += 1
        (self.out / "boards" / "poses.csv").write_text("\n".join(rows) + "\n")

    def _board_seen(
        self, picture: NDArray[np.float32], px: int, board_to_left: NDArray[np.float64], shift_m: float
    ) -> NDArray[np.float32] | None:
        """None where the board is not whole in the picture. Four times as fine, then averaged."""
        there = board_to_left.copy()
        there[0, 3] += shift_m
        fine, metre = 4, SQUARE_M / px
        H = K @ there[:3, [0, 1, 3]] @ np.array([[metre, 0, 0.5 * metre], [0, metre, 0.5 * metre], [0, 0, 1.0]])
        high, wide = picture.shape
        corners = cv2.perspectiveTransform(np.array([[[0.0, 0], [wide, 0], [wide, high], [0, high]]]), H)[0]
        if (corners < 6).any() or (corners > np.array([WIDTH, HEIGHT]) - 7).any():
            return None
        # Pixel centres at integers: fine pixel f is at (f + 0.5) / fine - 0.5.
        finer = np.array([[fine, 0, 0.5 * fine - 0.5], [0, fine, 0.5 * fine - 0.5], [0, 0, 1.0]])
        size = (fine * WIDTH, fine * HEIGHT)
        seen = cv2.warpPerspective(picture, finer @ H, size, flags=cv2.INTER_AREA, borderValue=90.0)
        return np.asarray(cv2.resize(seen, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), np.float32)

    def write_walls(self) -> None:
        for name, distance_m in WALLS_M.items():
            scene = kuafu.Scene(self.device)
            wall = meshes.sheet((-2.0, 1.6, distance_m), (4.0, 0, 0), (0, -3.2, 0))
            number = scene.add_mesh(wall.positions, wall.indices.reshape(-1, 3), normals=wall.normals)
            paint = kuafu.Material(base_color=(0.6, 0.6, 0.6, 1), roughness=1.0, specular=0.0)
            scene.add_instance(number, [scene.add_material(paint)])
            scene.set_environment((0.0, 0.0, 0.0), ir_radiance=0.0)
            light = self.infrared(scene, np.eye(4), True, 0, 32 * self.samples)
            for k in range(REPEATS):
                for side, image in zip(("left", "right"), light, strict=True):
                    picture = self.counts(WALL_EXPOSURE * image)
                    write_gray(_made(self.out / "walls" / name / side) / f"{k:03d}.png", picture)
        for k in range(20):
            write_gray(_made(self.out / "covered") / f"{k:03d}.png", self.counts(np.zeros((HEIGHT, WIDTH))))

    def write_desk(self, poses: int) -> None:
        _write_room(self.out / "desk.gltf", {"baseColorFactor": [1.0] * 4, **_MATT})
        card = {"baseColorFactor": [0.8, 0.55, 0.3, 1.0], "metallicFactor": 0.0, "roughnessFactor": BOX_ROUGHNESS}
        _write_room(self.out / "truth.gltf", card, BOX_ALBEDO)
        scene = kuafu.Scene(self.device)
        scene.load(self.out / "truth.gltf")
        scene.set_environment((0.3, 0.3, 0.3), ir_radiance=0.06)
        rows = ["name,x,y,z,qx,qy,qz,qw"]
        for k, angle in enumerate(np.deg2rad(np.linspace(-60.0, 60.0, poses))):
            eye_m = (0.42 * np.sin(angle), 0.3, 0.42 * np.cos(angle))
            pose = look_at(eye=eye_m, target=(0.02, 0.03, 0.01), up=(0, 1, 0))
            name = f"{k:03d}.png"
            for mode, on in (("on", True), ("off", False)):
                for side, image in zip(("left", "right"), self.infrared(scene, pose, on, 3, self.samples), strict=True):
                    write_gray(_made(self.out / "desk" / mode / side) / name, self.counts(image))
            camera = kuafu.Camera(WIDTH, HEIGHT, K, pose @ rigid_motion((COLOR_PLACE_M, 0.0, 0.0)))
            seen = self.renderer.render(scene, [camera], band="visible", spp=self.samples, max_bounces=3)["radiance"][0]
            seen = np.clip(0.7 * seen + self.random.normal(0.0, 0.004, seen.shape), 0, 1)
            picture = np.rint(255 * srgb.encoded(seen)).astype(np.uint8)
            write_png(_made(self.out / "desk" / "off" / "color") / name, picture)
            rows.append(_csv_row(name, pose @ np.linalg.inv(CAMERA_TO_GRIPPER)))
        (self.out / "desk" / "poses.csv").write_text("\n".join(rows) + "\n")

    def write_truth(self) -> None:
        truth = {
            "camera_to_gripper": CAMERA_TO_GRIPPER.ravel().tolist(), "box_to_base": BOX_TO_BASE.ravel().tolist(),
            "projector_place_m": PROJECTOR_PLACE_M, "focal_px": FOCAL_PX, "baseline_m": BASELINE_M,
            "black_dn": BLACK_DN,
            "read_dn": READ_DN, "shot_dn": SHOT_DN, "box_roughness": BOX_ROUGHNESS, "box_ir_albedo": BOX_ALBEDO,
        }  # fmt: skip
        write_json(self.out / "truth.json", truth)


_MATT = {"metallicFactor": 0.0, "roughnessFactor": 1.0}


def _write_room(path: Path, card: dict[str, Any], albedo: float | None = None) -> None:
    """The desk with the box of this material, whose infrared albedo is its base colour's unless it is given."""
    writer = GltfWriter()
    matt = {"KHR_materials_specular": {"specularFactor": 0.0}}
    table = writer.add_material(
        "table",
        pbrMetallicRoughness={"baseColorFactor": [0.3, 0.35, 0.42, 1.0], **_MATT},
        extensions=matt,
        extras={"ir_albedo": 0.4},
    )
    writer.add_mesh("table", meshes.box(1.6, 0.02, 1.6), table, (0.0, -0.02, 0.0))
    own = writer.add_material("box", pbrMetallicRoughness=card, extras={} if albedo is None else {"ir_albedo": albedo})
    writer.add_placed_mesh("box", meshes.box(*BOX_M), own, BOX_TO_BASE)
    writer.add_light("lamp", (-0.6, 1.1, 0.5), (1.0, 0.95, 0.9), 1.2)
    writer.write(path)


def _csv_row(name: str, pose: NDArray[np.float64]) -> str:
    values = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
    return ",".join([name, *(f"{value:.9g}" for value in values)])


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder that does not exist yet")
    parser.add_argument("--samples", type=int, default=16, help="per pixel (default: 16)")
    parser.add_argument("--poses", type=int, default=5, help="of the camera over the desk (default: 5)")
    args = parser.parse_args()
    args.out.mkdir(parents=True)
    practice = Practice(args.out, args.samples)
    practice.write_calibration()
    practice.write_boards()
    practice.write_walls()
    practice.write_desk(args.poses)
    practice.write_truth()
    print(f"written: d435.txt, boards, walls, covered, desk, desk.gltf and truth.json in {args.out}")


if __name__ == "__main__":
    main()
