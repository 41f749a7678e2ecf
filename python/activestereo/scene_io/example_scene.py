# SPDX-License-Identifier: Apache-2.0
"""Writes the example scene: objects on a table before a wall, each of a material that reflects projected light
differently.

    python -m activestereo.scene_io.example_scene table_top.gltf

World axes are glTF's (y up); the table top is y = 0. The node "camera" is where a sensor would be, 0.5 to 1.4 m from
the objects. Two lamps near the ceiling light the middle of the table with 240 lux. Light from a room's walls,
ROOM_RADIANCE of staging.py, adds 70 lux. The sum is within 300 to 500 lux, as EN 12464-1 asks of offices."""

import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.common.output_files import png_bytes
from activestereo.common.pose import look_at
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter

# White light has 250 to 370 lm/W at best (Murphy, Maximum spectral luminous efficacy of white light, J. Appl. Phys.
# 111, 2012). The imagers of the D400 have no infrared filter, and see it in full.
WHITE_LM_PER_W = 300.0
LAMPS = (("lamp", (-0.35, 1.6, 0.15), (1.0, 0.93, 0.84), 1.8), ("fill", (1.0, 1.5, 0.6), (0.80, 0.90, 1.0), 0.7))

CAMERA_TO_WORLD = look_at(eye=(-0.02, 0.46, 0.72), target=(0.0, 0.035, -0.02), up=(0.0, 1.0, 0.0))


def write_table_top(path: str | Path, is_matt: bool = False) -> None:
    """Writes the scene to a .gltf or .glb file, with the same bytes each time. is_matt: all surfaces are diffuse, and
    glass objects are left out."""
    writer = GltfWriter("activestereo example scene")
    material = _materials(writer, is_matt)
    writer.add_mesh("table", meshes.box(1.7, 0.04, 0.95), material["wood"], (0.0, -0.04, -0.02))
    writer.add_mesh("wall", meshes.sheet((-1.6, -0.8, -0.5), (3.2, 0, 0), (0, 2.2, 0)), material["wall"])
    writer.add_mesh("vase", meshes.vase(0.20), material["ceramic"], (-0.20, 0.0, -0.16))
    writer.add_mesh("ring", meshes.torus(0.052, 0.02), material["clay"], (-0.055, 0.0, 0.13))
    writer.add_mesh("ball", meshes.sphere(0.055), material["clay"], (-0.275, 0.055, 0.10))
    writer.add_mesh("steel ball", meshes.sphere(0.06), material["steel"], (0.045, 0.06, -0.06))
    outline = (0.0, 0.0), (0.035, 0.0), (0.035, 0.11), (0.0, 0.11)
    cylinder = meshes.lathe([list(side) for side in pairwise(outline)])
    writer.add_mesh("brass cylinder", cylinder, material["brass"], (0.335, 0.0, -0.20))
    if not is_matt:
        writer.add_mesh("tumbler", meshes.tumbler(0.038, 0.115, 0.0035, 0.012), material["glass"], (0.17, 0.0, 0.055))
        writer.add_mesh("glass ball", meshes.sphere(0.035), material["glass"], (0.09, 0.035, 0.20))
    writer.add_mesh("dark block", meshes.box(0.11, 0.075, 0.09), material["velvet"], (0.325, 0.0, 0.05), yaw_deg=28.0)
    writer.add_mesh("box", meshes.box(0.17, 0.12, 0.10), material["card"], (0.15, 0.0, -0.26), yaw_deg=-14.0)
    for name, place, color, intensity in LAMPS:
        writer.add_light(name, place, color, intensity)
    writer.add_camera("camera", CAMERA_TO_WORLD, vertical_fov=float(np.deg2rad(43.3)), aspect_ratio=848 / 480)
    writer.write(path)


def _materials(writer: GltfWriter, is_matt: bool) -> dict[str, int]:
    """Adds all materials and returns {name: index}. ir_albedo is the diffuse albedo (a metal's reflectance) at 850
    nm."""
    table = {  # colour, roughness, metallic, ir_albedo; roughness None: Lambertian
        "wood": ((1.0, 1.0, 1.0), 0.65, 0.0, 0.52),
        "wall": ((0.62, 0.66, 0.68), None, 0.0, 0.60),
        "clay": ((0.70, 0.27, 0.15), None, 0.0, 0.55),
        "ceramic": ((0.10, 0.30, 0.52), 0.18, 0.0, 0.45),
        "card": ((0.63, 0.47, 0.30), None, 0.0, 0.60),
        "steel": ((0.66, 0.64, 0.61), 0.22, 1.0, 0.68),
        "brass": ((0.88, 0.68, 0.32), 0.38, 1.0, 0.85),
        "glass": ((1.0, 1.0, 1.0), 0.0, 0.0, None),
        "velvet": ((0.012, 0.012, 0.014), None, 0.0, 0.004),
    }
    wood, numbers = writer.add_texture(_wood_png(), "planks"), {}
    for name, (color, roughness, metallic, ir_albedo) in table.items():
        extensions: dict[str, Any] = {}
        if is_matt:
            color, roughness, metallic = (0.5, 0.5, 0.5), None, 0.0
        pbr: dict[str, Any] = {"baseColorFactor": [*color, 1.0], "metallicFactor": metallic}
        pbr["roughnessFactor"] = 1.0 if roughness is None else roughness
        if name == "wood" and not is_matt:
            pbr["baseColorTexture"] = {"index": wood}
        fields: dict[str, Any] = {"pbrMetallicRoughness": pbr}
        if ir_albedo is not None:
            fields["extras"] = {"ir_albedo": ir_albedo}
        elif is_matt:
            continue
        else:
            extensions = {"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": 1.5}}
            extensions["KHR_materials_volume"] = {"thicknessFactor": 0.01}  # without: a sheet; the mesh says how thick
        if roughness is None:
            extensions["KHR_materials_specular"] = {"specularFactor": 0.0}
        if extensions:
            fields["extensions"] = extensions
        numbers[name] = writer.add_material(name, **fields)
    return numbers


def _wood_png(width: int = 1024, height: int = 572, planks: int = 6) -> bytes:
    """Draws wooden planks with a little grain as an sRGB PNG file."""
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
    return png_bytes(pixels)


def main(arguments: Sequence[str] | None = None) -> int:
    arguments = sys.argv[1:] if arguments is None else arguments
    if len(arguments) != 1 or arguments[0].startswith("-"):
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
