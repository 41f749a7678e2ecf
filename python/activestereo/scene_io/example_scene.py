# SPDX-License-Identifier: Apache-2.0
"""The example scene: things on a table in front of a wall, each of a material that treats projected light differently.

    python -m activestereo.scene_io.example_scene table_top.gltf

World axes are glTF's (y up); the table top is y = 0. The node "camera" stands where a sensor would, 0.5 to 1.4 m from
what it sees. Two lamps near the ceiling light the middle of the table with 240 lux, and what a room's walls send back,
ROOM_RADIANCE of staging.py, with 70 more: within 300 to 500 lux, as EN 12464-1 asks of offices.
"""

import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from activestereo.common.pose import look_at
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter

# White light has 250 to 370 lm/W at best (Murphy, Maximum spectral luminous efficacy of white light, J. Appl. Phys.
# 111, 2012). The imagers of the D400 have no infrared filter, and see it in full.
WHITE_LM_PER_W = 300.0
LAMPS = (
    ("lamp", (-0.35, 1.6, 0.15), (1.0, 0.93, 0.84), 1.8),
    ("fill", (1.0, 1.5, 0.6), (0.80, 0.90, 1.0), 0.7),
)

CAMERA_TO_WORLD = look_at(eye=(-0.02, 0.46, 0.72), target=(0.0, 0.035, -0.02), up=(0.0, 1.0, 0.0))


def write_table_top(path: str | Path, is_matt: bool = False) -> None:
    """Writes the scene to a .gltf or .glb file; the same bytes each time. is_matt: all surfaces scatter light evenly,
    and what is of glass is left out."""
    writer = GltfWriter("activestereo example scene")
    material = _materials(writer, is_matt)
    writer.add_mesh("table", meshes.box(1.7, 0.04, 0.95), material["wood"], (0.0, -0.04, -0.02))
    writer.add_mesh("wall", meshes.sheet((-1.6, -0.8, -0.5), (3.2, 0, 0), (0, 2.2, 0)), material["wall"])
    writer.add_mesh("vase", meshes.vase(0.20), material["ceramic"], (-0.20, 0.0, -0.16))
    writer.add_mesh("ring", meshes.torus(0.052, 0.02), material["clay"], (-0.055, 0.0, 0.13))
    writer.add_mesh("ball", meshes.sphere(0.055), material["clay"], (-0.275, 0.055, 0.10))
    writer.add_mesh("steel ball", meshes.sphere(0.06), material["steel"], (0.045, 0.06, -0.06))
    writer.add_mesh("brass cylinder", _cylinder(0.035, 0.11), material["brass"], (0.335, 0.0, -0.20))
    if not is_matt:
        writer.add_mesh("tumbler", meshes.tumbler(0.038, 0.115, 0.0035, 0.012), material["glass"], (0.17, 0.0, 0.055))
        writer.add_mesh("glass ball", meshes.sphere(0.035), material["glass"], (0.09, 0.035, 0.20))
    writer.add_mesh("dark block", meshes.box(0.11, 0.075, 0.09), material["velvet"], (0.325, 0.0, 0.05), yaw_deg=28.0)
    writer.add_mesh("box", meshes.box(0.17, 0.12, 0.10), material["card"], (0.15, 0.0, -0.26), yaw_deg=-14.0)
    for name, place, color, intensity in LAMPS:
        writer.add_point_light(name, place, color, intensity)
    writer.add_camera("camera", CAMERA_TO_WORLD, vertical_fov=float(np.deg2rad(43.3)), aspect_ratio=848 / 480)
    writer.write(path)


def _materials(writer: GltfWriter, is_matt: bool) -> dict[str, int]:
    """{name: index}. ir_albedo is the diffuse albedo (a metal's reflectance) at 850 nm."""
    wood = writer.add_texture(_wood_png(), "planks")
    table = {
        "wood": _dielectric((1.0, 1.0, 1.0), 0.65, ir_albedo=0.52, texture=wood),
        "wall": _lambertian((0.62, 0.66, 0.68), ir_albedo=0.60),
        "clay": _lambertian((0.70, 0.27, 0.15), ir_albedo=0.55),
        "ceramic": _dielectric((0.10, 0.30, 0.52), 0.18, ir_albedo=0.45),
        "card": _lambertian((0.63, 0.47, 0.30), ir_albedo=0.60),
        "steel": _metal((0.66, 0.64, 0.61), 0.22, ir_albedo=0.68),
        "brass": _metal((0.88, 0.68, 0.32), 0.38, ir_albedo=0.85),
        "glass": _glass(1.5),
        "velvet": _lambertian((0.012, 0.012, 0.014), ir_albedo=0.004),
    }
    if is_matt:
        del table["glass"]
        table = {name: _lambertian((0.5, 0.5, 0.5), **fields["extras"]) for name, fields in table.items()}
    return {name: writer.add_material(name, **fields) for name, fields in table.items()}


def _dielectric(
    color: Sequence[float], roughness: float, ir_albedo: float, texture: int | None = None
) -> dict[str, Any]:
    pbr = {"baseColorFactor": [*color, 1.0], "metallicFactor": 0.0, "roughnessFactor": roughness}
    if texture is not None:
        pbr["baseColorTexture"] = {"index": texture}
    return {"pbrMetallicRoughness": pbr, "extras": {"ir_albedo": ir_albedo}}


def _lambertian(color: Sequence[float], ir_albedo: float) -> dict[str, Any]:
    return {**_dielectric(color, 1.0, ir_albedo), "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}}}


def _metal(color: Sequence[float], roughness: float, ir_albedo: float) -> dict[str, Any]:
    fields = _dielectric(color, roughness, ir_albedo)
    fields["pbrMetallicRoughness"]["metallicFactor"] = 1.0
    return fields


def _glass(ior: float) -> dict[str, Any]:
    extensions = {"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": ior}}
    extensions["KHR_materials_volume"] = {"thicknessFactor": 0.01}  # without: a sheet; how thick it is, its mesh says
    pbr = {"baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.0}
    return {"pbrMetallicRoughness": pbr, "extensions": extensions}


def _cylinder(radius: float, height: float) -> meshes.Mesh:
    return meshes.lathe(
        [[(0.0, 0.0), (radius, 0.0)], [(radius, 0.0), (radius, height)], [(radius, height), (0.0, height)]]
    )


def _wood_png(width: int = 1024, height: int = 572, planks: int = 6) -> bytes:
    """Six planks with a little grain, sRGB."""
    random = np.random.Generator(np.random.PCG64(5))
    u, v = np.meshgrid(np.linspace(0.0, 1.0, width), np.linspace(0.0, 1.0, height) * planks)
    plank = np.minimum(v.astype(int), planks - 1)
    tone, phase = random.random(planks)[plank], 40.0 * random.random(planks)[plank]
    across = v - plank
    rings = across * 9.0 + 0.9 * np.sin(u * 5.0 + phase) + 0.25 * np.sin(u * 23.0 + 3.0 * phase) + phase
    grain = 0.5 + 0.5 * np.sin(2.0 * np.pi * rings)
    gap = np.clip(np.minimum(across, 1.0 - across) / 0.015, 0.35, 1.0)
    shade = (0.80 + 0.16 * tone + 0.07 * grain) * gap
    pixels = np.rint(255.0 * np.clip(shade[..., None] * [0.80, 0.62, 0.44], 0.0, 1.0)).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="png")
    return file.getvalue()


def main(arguments: Sequence[str] | None = None) -> int:
    arguments = sys.argv[1:] if arguments is None else arguments
    if len(arguments) != 1:
        print("usage: python -m activestereo.scene_io.example_scene FILE.gltf|FILE.glb", file=sys.stderr)
        return 2
    try:
        write_table_top(arguments[0])
    except (OSError, ValueError) as error:
        print(f"example_scene: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
