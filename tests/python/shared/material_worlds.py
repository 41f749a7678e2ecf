# SPDX-License-Identifier: Apache-2.0
"""Shared by tests and by hand: captures of a painted ball on a table, rendered by kuafu, whose paint is known."""

from pathlib import Path

import numpy as np

import kuafu
from activestereo import meshes
from activestereo.capture import Camera, Capture, ColorCamera, Frame, Projector, Rig
from activestereo.capture_write import write_capture
from activestereo.gltf_writer import GltfWriter
from activestereo.pattern import PatternDesign, make_pattern
from activestereo.pose import look_at

# roughness, metallic, specular, transmission, ir_albedo
PAINTS = {
    "plastic": (0.35, 0.0, 1.0, 0.0, 0.5), "brushed": (0.3, 1.0, 1.0, 0.0, 0.68), "matte": (0.9, 0.0, 0.0, 0.0, 0.55),
    "ceramic": (0.12, 0.0, 1.0, 0.0, 0.45), "painted": (0.4, 0.5, 0.5, 0.0, 0.5),
}  # fmt: skip
NOMINAL = (0.6, 0.0, 1.0, 0.0, 0.4)
_PATTERN = PatternDesign(width=848, height=480, dot_pitch_px=14.4, dot_sigma_px=1.8, seed=2)
_PATTERN_K = np.array([[400.0, 0, 423.5], [0, 400.0, 239.5], [0, 0, 1.0]])


def write_room(path, paint):
    """Table, ball and two lamps."""
    roughness, metallic, specular, transmission, albedo = paint
    writer = GltfWriter()
    table = writer.add_material(
        "table",
        pbrMetallicRoughness={"baseColorFactor": [0.5, 0.45, 0.4, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0},
        extensions={"KHR_materials_specular": {"specularFactor": 0.0}}, extras={"ir_albedo": 0.52},
    )  # fmt: skip
    extensions = {"KHR_materials_specular": {"specularFactor": specular}}
    if transmission > 0:
        extensions["KHR_materials_transmission"] = {"transmissionFactor": transmission}
    color = {"baseColorFactor": [0.6, 0.25, 0.2, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
    own = writer.add_material("paint", pbrMetallicRoughness=color, extensions=extensions, extras={"ir_albedo": albedo})
    writer.add_mesh("table", meshes.box(1.2, 0.02, 1.2), table, (0.0, -0.02, 0.0))
    writer.add_mesh("ball", meshes.sphere(0.05), own, (0.0, 0.05, 0.0))
    writer.add_point_light("lamp", (-0.6, 1.1, 0.5), (1.0, 0.93, 0.84), 1.5)
    writer.add_point_light("second", (0.7, 0.9, 0.6), (0.8, 0.9, 1.0), 1.0)
    writer.write(path)


def record(folder, paint, nominal=NOMINAL, scale=1.0, samples=256, poses=2):
    """The capture of a ball of one paint, whose scene says another; with the projector on and off, and in colour."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_room(folder / "true.gltf", paint)
    write_room(folder / "scene.gltf", nominal)
    width, height, f = int(200 * scale), int(150 * scale), 150.0 * scale
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1.0]])
    device, rng = kuafu.Device(), np.random.default_rng(0)
    renderer, pattern = kuafu.Renderer(device), make_pattern(_PATTERN)
    right, to_projector = np.eye(4), np.eye(4)
    right[0, 3], to_projector[0, 3] = -0.05, -0.029
    camera = Camera(width, height, K)
    rig = Rig(
        camera, camera, right, Projector(folder / "none", _PATTERN_K, to_projector), color=ColorCamera(width, height, K)
    )
    frames, images, colors = [], {}, {}
    for k in range(poses):
        azimuth, elevation = np.deg2rad(50.0 * k), np.deg2rad(35.0 - 10.0 * k)
        place = 0.5 * np.array(
            [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
        )
        pose = look_at(eye=place + [0, 0.05, 0], target=(0, 0.05, 0), up=(0, 1, 0))
        for lit in (True, False):
            scene = kuafu.Scene(device)
            scene.load(folder / "true.gltf")
            scene.set_environment((0.25, 0.25, 0.25), ir_radiance=0.02)
            if lit:
                light = kuafu.Light(
                    kind="projector", ir_intensity=3.0, texture=scene.add_texture(pattern), k=_PATTERN_K
                )
                light.light_to_world = pose @ np.linalg.inv(to_projector)
                scene.add_light(light)
            how = {"spp": samples, "max_bounces": 6}
            view = kuafu.Camera(width, height, K, pose)
            gray = 5.0 + 700.0 * renderer.render(scene, [view], seed=77 + k, **how)["radiance"][0, ..., 0]
            gray = gray + rng.normal(size=gray.shape) * np.sqrt(0.005 * gray + 0.1)
            number = 2 * k + lit
            frames.append(Frame(number, None, None, float(number), 0.008, pose, "train", projector_power=float(lit)))
            images[number, "left"] = images[number, "right"] = np.clip(np.rint(gray), 0, 255).astype(np.uint8)
            if lit:
                seen = 0.6 * renderer.render(scene, [view], band="visible", seed=99 + k, **how)["radiance"][0]
                seen = np.clip(seen + 0.004 * rng.normal(size=seen.shape), 0, 1)
                srgb = np.where(seen < 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
                colors[number] = np.rint(255 * srgb).astype(np.uint8)
    capture = Capture(folder, "ball", folder / "scene.gltf", rig, tuple(frames))
    write_capture(folder / "capture", capture, images, pattern, colors=colors)
    return folder / "capture"
