# SPDX-License-Identifier: Apache-2.0
"""Shared by tests and by hand: captures of a painted thing on a table, rendered by kuafu, whose paint is known."""

from pathlib import Path

import numpy as np

import kuafu
from activestereo.common.pose import look_at, rigid_motion
from activestereo.scene_io import meshes
from activestereo.calibrate.material_fit import MaterialScene, Picture, pictures
from activestereo.capture.capture import Camera, Capture, ColorCamera, Frame, Projector, Rig, read_capture
from activestereo.capture.write import write_capture
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.common.pattern import PatternDesign, make_pattern
from activestereo.effects.core.surfaces import surfaces_of_object

# roughness, metallic, specular, transmission, ir_albedo
PAINTS = {
    "plastic": (0.35, 0.0, 1.0, 0.0, 0.5), "brushed": (0.3, 1.0, 1.0, 0.0, 0.68), "matte": (0.9, 0.0, 0.0, 0.0, 0.55),
    "ceramic": (0.12, 0.0, 1.0, 0.0, 0.45), "painted": (0.4, 0.5, 0.5, 0.0, 0.5),
}  # fmt: skip
NOMINAL = (0.6, 0.0, 1.0, 0.0, 0.4)
COLOR = (0.6, 0.25, 0.2)
_PATTERN = PatternDesign(width=848, height=480, dot_pitch_px=14.4, dot_sigma_px=1.8, seed=2)
PATTERN_K = np.array([[400.0, 0, 423.5], [0, 400.0, 239.5], [0, 0, 1.0]])
BASELINE_M = 0.05
LEFT_TO_PROJECTOR = rigid_motion((-0.029, 0, 0))
DN, BLACK_DN, SHOT_DN, READ_DN = 700.0, 5.0, 0.005, 0.1**0.5
ROOM, IR_ROOM, IR_PROJECTOR = 0.25, 0.02, 3.0  # radiance; W/sr at the pattern's brightest
LAMPS = (((-0.6, 1.1, 0.5), (1.0, 0.93, 0.84), 1.5), ((0.7, 0.9, 0.6), (0.8, 0.9, 1.0), 1.0))  # place, colour, light
TABLE_COLOR, TABLE_ALBEDO = (0.5, 0.45, 0.4), 0.52


def mesh_of(shape):
    if shape == "box":
        return meshes.box(0.11, 0.08, 0.06)
    if shape == "cup":
        return meshes.tumbler(0.042, 0.09, 0.004, 0.006)
    return meshes.sphere(0.05)


def place_of(shape):
    """A ball stands on its lowest point; a box shows two sides."""
    pose = rigid_motion((0, 0.05 if shape == "ball" else 0.0, 0))
    if shape == "box":
        turn = np.deg2rad(35.0)
        pose[0, [0, 2]], pose[2, [0, 2]] = (np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))
    return pose


def write_room(path, paint, shape="ball", color=COLOR):
    """Table, thing and two lamps; y is up."""
    roughness, metallic, specular, transmission, albedo = paint
    writer = GltfWriter()
    table = writer.add_material(
        "table",
        pbrMetallicRoughness={"baseColorFactor": [*TABLE_COLOR, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0},
        extensions={"KHR_materials_specular": {"specularFactor": 0.0}}, extras={"ir_albedo": TABLE_ALBEDO},
    )  # fmt: skip
    extensions = {"KHR_materials_specular": {"specularFactor": specular}}
    if transmission > 0:
        extensions["KHR_materials_transmission"] = {"transmissionFactor": transmission}
    surface = {"baseColorFactor": [*color, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
    extras = {"ir_albedo": albedo}
    own = writer.add_material("paint", pbrMetallicRoughness=surface, extensions=extensions, extras=extras)
    writer.add_mesh("table", meshes.box(1.2, 0.02, 1.2), table, (0.0, -0.02, 0.0))
    writer.add_placed_mesh(shape, mesh_of(shape), own, place_of(shape))
    for name, lamp in zip(("lamp", "second"), LAMPS):
        writer.add_light(name, *lamp)
    writer.write(path)


def intrinsics(scale=1.0):
    """(width, height, K)"""
    width, height, f = int(200 * scale), int(150 * scale), 150.0 * scale
    return width, height, np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1.0]])


def camera_pose(k):
    """The camera's pose around the thing; k: 0, 1 and on are the recorded places, others lie between them."""
    azimuth, elevation = np.deg2rad(50.0 * k), np.deg2rad(35.0 - 10.0 * k)
    place = 0.5 * np.array(
        [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
    )
    return look_at(eye=place + [0, 0.05, 0], target=(0, 0.05, 0), up=(0, 1, 0))


def counts(light, rng):
    """Infrared light as the camera counts it, without a range: shot and read noise."""
    gray = BLACK_DN + DN * light
    return gray + rng.normal(size=gray.shape) * np.sqrt(SHOT_DN * gray + READ_DN**2)


def pattern():
    return make_pattern(_PATTERN)


def _seen_by_kuafu(gltf, scale, samples):
    width, height, K = intrinsics(scale)
    device = kuafu.Device()
    renderer = kuafu.Renderer(device)

    def see(pose, lit, band, seed):
        scene = kuafu.Scene(device)
        scene.load(gltf)
        scene.set_environment((ROOM, ROOM, ROOM), ir_radiance=IR_ROOM)
        if lit:
            texture = scene.add_texture(pattern())
            light = kuafu.Light(kind="projector", ir_intensity=IR_PROJECTOR, texture=texture, k=PATTERN_K)
            light.light_to_world = pose @ np.linalg.inv(LEFT_TO_PROJECTOR)
            scene.add_light(light)
        view = kuafu.Camera(width, height, K, pose)
        image = renderer.render(scene, [view], seed=seed, band=band, spp=samples, max_bounces=6)["radiance"][0]
        return image[..., 0] if band == "infrared" else image

    return see


def record(
    folder, paint, nominal=NOMINAL, scale=1.0, samples=256, poses=2, shape="ball", color=COLOR, nominal_color=COLOR,
    see=None,
):  # fmt: skip
    """The capture of a thing of one paint, whose scene says another; with the projector on and off, and in colour.
    see: what renders it in kuafu's place, of (pose of the camera, is the projector on, band, seed): [height][width],
    with three channels where the band is visible."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_room(folder / "true.gltf", paint, shape, color)
    write_room(folder / "scene.gltf", nominal, shape, nominal_color)
    width, height, K = intrinsics(scale)
    see, rng = see or _seen_by_kuafu(folder / "true.gltf", scale, samples), np.random.default_rng(0)
    camera = Camera(width, height, K)
    projector = Projector(folder / "none", PATTERN_K, LEFT_TO_PROJECTOR)
    rig = Rig(camera, camera, rigid_motion((-BASELINE_M, 0, 0)), projector, color=ColorCamera(width, height, K))
    frames, images, colors = [], {}, {}
    for k in range(poses):
        pose = camera_pose(k)
        for lit in (True, False):
            gray = counts(see(pose, lit, "infrared", 77 + k), rng)
            number = 2 * k + lit
            frames.append(Frame(number, None, None, float(number), 0.008, pose, "train", projector_power=float(lit)))
            images[number, "left"] = images[number, "right"] = np.clip(np.rint(gray), 0, 255).astype(np.uint8)
            if lit:
                seen = 0.6 * see(pose, lit, "visible", 99 + k)
                seen = np.clip(seen + 0.004 * rng.normal(size=seen.shape), 0, 1)
                srgb = np.where(seen < 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
                colors[number] = np.rint(255 * srgb).astype(np.uint8)
    capture = Capture(folder, shape, folder / "scene.gltf", rig, tuple(frames))
    write_capture(folder / "capture", capture, images, pattern(), colors=colors)
    return folder / "capture"


def seen_of(path: Path, object_name: str) -> tuple[MaterialScene, list[Picture], list[int]]:
    """A capture's scene as it is rendered, its pictures, and the numbers of an object's surfaces."""
    capture = read_capture(path)
    surfaces = surfaces_of_object(capture.scene_path, object_name)
    scene = MaterialScene(capture)
    return scene, pictures(scene, capture, surfaces), surfaces
