# SPDX-License-Identifier: Apache-2.0
"""From views of a room with depth to the effect that a camera's model lacks: import, calibrate world, compare and
diagnose; and the camera's own depth beside the simulated one.

    PYTHONPATH=build/python python3 examples/real_camera/room.py OUT

renders the recording: four views of a painted room by a D415 at 480x270 whose lens darkens by cos^4.5 and whose
projector stands 1.5 mm off its nominal place. With recordings of a real camera, one view held out:

    ... room.py OUT --views VIEWS --test 2 -- --sensor d415 --k 899.5,899.5,639.5,359.5 --baseline 0.055 \\
        --depth laser --depth-scale 0.001

--own 'VIEWS/*/img_depth_rs.png' names the camera's own depth beside a laser's. What follows -- goes to `activestereo
import`, whose help says what VIEWS may be.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo import StereoDepthSensorConfig
from activestereo.camera.plan import pattern_of
from activestereo.capture.images import write_gray
from activestereo.cli import main as activestereo
from activestereo.common.pose import rigid_motion
from activestereo.scene_io import meshes
from three_depths import three_depths

WIDTH, HEIGHT = 480, 270
K = np.array([[340.0, 0, 236.0], [0, 340.0, 137.0], [0, 0, 1.0]])
NOMINAL = "337,337,239.5,134.5"
BASELINE_M, PROJECTOR_PLACE_M = 0.055, (0.0275, 0.001, -0.001)
EXPONENT, BLACK_DN, READ_DN, SHOT_DN = 4.5, 4.0, 0.4, 0.01
TURNS_DEG = ((0, 0), (14, 3), (-13, -4), (6, -3))
EXPOSURES = (1.0, 0.85, 1.3, 1.1)
# Walls, floor and boxes: a corner and two sides, metres; x right, y down, z forward.
SHEETS = [
    ((-2.0, -1.2, 2.1), (4.0, 0, 0.3), (0, 2.4, 0)), ((-1.1, -1.2, 0.2), (-0.3, 0, 3), (0, 2.4, 0)),
    ((1.0, -1.2, 0.2), (0.3, 0, 3), (0, 2.4, 0)), ((-2.0, 0.6, 0.2), (4.0, 0, 0), (0, 0, 3)),
    ((-0.6, 0.1, 1.4), (0.5, 0, 0.15), (0, 0.5, 0)), ((0.2, 0.2, 1.3), (0.45, 0, -0.1), (0, 0.4, 0)),
    ((-0.25, -0.5, 1.8), (0.5, 0.1, 0.1), (0.1, 0.5, 0.1)),
]  # fmt: skip


def _camera_to_world(turn_deg: tuple[float, float]) -> NDArray[np.float64]:
    """Turned about y and x around a tripod's axis, 5 cm behind the camera."""
    y, x = np.radians(turn_deg)
    rotation = cv2.Rodrigues(np.array([0, y, 0.0]))[0] @ cv2.Rodrigues(np.array([x, 0, 0.0]))[0]
    return rigid_motion(rotation @ (0, 0, 0.05) - (0, 0, 0.05), rotation)


def _paint(random: np.random.Generator, shade: float) -> NDArray[np.uint8]:
    """Smooth blotches around a shade, sRGB."""
    image = sum(cv2.GaussianBlur(random.normal(size=(256, 256)), (0, 0), s) * s for s in (4, 12, 30))
    gray = np.clip(shade * (1.0 + 0.35 * np.tanh(image)), 0.02, 0.98)
    return np.repeat(np.rint(255 * gray ** (1 / 2.2))[..., None], 3, axis=2).astype(np.uint8)


def record(out: Path, samples: int) -> None:
    """Writes left, right and depth (0.1 mm) of each view."""
    random, device = np.random.default_rng(5), kuafu.Device()
    scene, renderer = kuafu.Scene(device), kuafu.Renderer(device)
    for number, (corner, across, down) in enumerate(SHEETS):
        sheet = meshes.sheet(corner, across, down)
        texture = scene.add_texture(_paint(random, (0.55, 0.2)[number % 2]))
        material = kuafu.Material(base_color_texture=texture, roughness=1.0, specular=0.0)
        mesh = scene.add_mesh(sheet.positions, sheet.indices.reshape(-1, 3), normals=sheet.normals, uvs=sheet.uvs)
        scene.add_instance(mesh, [scene.add_material(material)])
    scene.set_environment((0.0, 0.0, 0.0), ir_radiance=0.12)
    pattern, pattern_K = pattern_of(StereoDepthSensorConfig("d415")) or (np.zeros((2, 2), np.uint8), np.eye(3))
    texture = scene.add_texture(pattern)
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    r2 = ((u - K[0, 2]) / K[0, 0]) ** 2 + ((v - K[1, 2]) / K[1, 1]) ** 2
    for k, (turn, exposure) in enumerate(zip(TURNS_DEG, EXPOSURES, strict=True)):
        pose = _camera_to_world(turn)
        places = [pose @ rigid_motion(place) for place in (PROJECTOR_PLACE_M, (0, 0, 0), (BASELINE_M, 0, 0))]
        light = kuafu.Light(kind="projector", ir_intensity=1.0, texture=texture, k=pattern_K, light_to_world=places[0])
        number = scene.add_light(light)
        cameras = [kuafu.Camera(WIDTH, HEIGHT, K, place) for place in places[1:]]
        seen = renderer.render(scene, cameras, ("radiance", "depth"), spp=samples, max_bounces=2)
        scene.remove_light(number)
        for side, radiance in zip(("left", "right"), seen["radiance"], strict=True):
            dn = 1300.0 * exposure * radiance[..., 0] * (1.0 + r2) ** (-EXPONENT / 2)
            noise = random.normal(size=dn.shape) * np.sqrt(READ_DN**2 + SHOT_DN * dn)
            image = np.clip(np.rint(np.maximum(dn + noise, 0.0) + BLACK_DN), 0, 255).astype(np.uint8)
            write_gray(_made(out / side) / f"{k:03d}.png", image)
        depth = seen["depth"][0, ..., 0] + random.normal(0, 3e-4, (HEIGHT, WIDTH))
        write_gray(_made(out / "depth") / f"{k:03d}.png", np.rint(1e4 * depth).astype(np.uint16))


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def own_depth(views: Path, out: Path) -> str:
    """The pairs as a D415 matches them, by the depth command, one image a view; their pattern."""
    for left in sorted((views / "left").glob("*.png")):
        pair = [str(left), str(views / "right" / left.name)]
        _run(["depth", *pair, "--k", NOMINAL, "--baseline", str(BASELINE_M), "--max-disparity", "64",
              "--out", str(out / left.stem)])  # fmt: skip
    return str(out / "*" / "depth.png")


def _run(*commands: list[str]) -> None:
    for command in commands:
        print("$ activestereo", " ".join(command), flush=True)
        if activestereo(command):
            raise SystemExit(1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder that does not exist yet")
    parser.add_argument("--views", type=Path, help="recordings of a real camera, in place of the rendered ones")
    parser.add_argument("--test", default="3", help="frame that is held out (default: 3)")
    parser.add_argument("--spp", default="16", help="samples per pixel of compare and diagnose (default: 16)")
    parser.add_argument("--own", help="pattern of the camera's own depth, an image for each view, millimetres")
    given = sys.argv[1:]
    end = given.index("--") if "--" in given else len(given)  # argparse gives a list of its own no options
    args, how = parser.parse_args(given[:end]), given[end + 1 :]
    args.out.mkdir(parents=True)
    views = args.views
    if views is None:
        views = args.out / "views"
        record(views, 64)
        args.own = own_depth(views, args.out / "own")
        how = ["--sensor", "d415", "--k", NOMINAL, "--baseline", str(BASELINE_M), "--depth-scale", "0.0001"]
    recording, capture = str(args.out / "recording"), str(args.out / "capture")
    _run(
        ["import", str(views), *how, "-o", recording],
        ["calibrate", "world", recording, "--test", args.test, "-o", capture],
        ["compare", capture, "--spp", args.spp, "--out", str(args.out / "compare")],
    )
    if args.own:
        print(three_depths(Path(capture), args.own, args.out / "three_depths", int(args.spp), 0.001), flush=True)
    _run(["diagnose", capture, "--spp", args.spp, "--out", str(args.out / "diagnosis")])


if __name__ == "__main__":
    main()
