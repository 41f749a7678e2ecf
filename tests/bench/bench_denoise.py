# SPDX-License-Identifier: Apache-2.0
"""How many samples the denoiser is worth: error of 2 filtered samples per pixel beside that of 2 and 32 plain ones,
against 4096.

Prints relative errors (root of the mean square over the mean) of all light but the projectors' direct one, and their
ratio. Open Image Denoise stands beside it where its library is found.

usage: PYTHONPATH=build/python python3 tests/bench/bench_denoise.py [--picture out.png] [--reference 4096]
"""

import argparse

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import kuafu
from activestereo.common.pose import rigid_motion
from activestereo.scene_io import meshes

WIDTH, HEIGHT, FOCAL_PX = 212, 120, 190.0
SEEDS = range(4)
METAL_ROUGHNESS = {"brushed metal": (0.5, 0.4, 0.6), "polished metal": (0.25, 0.05, 0.5)}
KINDS = ("diffuse", *METAL_ROUGHNESS, "glass")


def add(scene, mesh, material, place=(0, 0, 0), yaw=0.0):
    number = scene.add_mesh(mesh.positions, mesh.indices, normals=mesh.normals, uvs=mesh.uvs)
    pose = rigid_motion(place, Rotation.from_euler("y", yaw).as_matrix())
    scene.add_instance(number, [material], local_to_world=pose)


def objects(kind):
    """Materials of the large ball, the small ball and the box."""
    material = kuafu.Material
    if kind == "diffuse":
        return [material(base_color=(*c, 1), specular=0.0) for c in ((0.8, 0.3, 0.2), (0.2, 0.5, 0.8), (0.5, 0.8, 0.3))]
    if kind in METAL_ROUGHNESS:
        colors = (0.95, 0.8, 0.5), (0.9, 0.9, 0.9), (0.9, 0.6, 0.5)
        return [material(base_color=(*c, 1), metallic=1.0, roughness=r) for c, r in zip(colors, METAL_ROUGHNESS[kind])]
    return [
        material(transmission=1.0, roughness=0.0, ior=1.5),
        material(base_color=(0.9, 1, 0.95, 1), transmission=1.0, roughness=0.0, ior=1.33),
        material(base_color=(0.5, 0.8, 0.3, 1), roughness=0.3),
    ]


def table_top(device, kind):
    """A checkered table, a wall, two balls and a box; a lamp, dots, and the sky."""
    rng = np.random.default_rng(3)
    scene = kuafu.Scene(device)
    cells = np.kron(rng.uniform(0.3, 0.9, (24, 24, 3)), np.ones((4, 4, 1))).astype(np.float32)
    gloss = dict(specular=0.0) if kind == "diffuse" else dict(specular=0.5, roughness=0.6)
    table = scene.add_material(
        kuafu.Material(base_color=(0.7, 0.65, 0.6, 1), base_color_texture=scene.add_texture(cells), **gloss)
    )
    wall = scene.add_material(kuafu.Material(base_color=(0.6, 0.7, 0.75, 1), specular=0.0))
    large, small, block = (scene.add_material(m) for m in objects(kind))
    add(scene, meshes.sheet((-0.8, 0.25, 0.4), (1.6, 0, 0), (0, 0, 1.2)), table)
    add(scene, meshes.sheet((1.0, -0.7, 1.5), (-2.0, 0, 0), (0, 1.2, 0)), wall)
    add(scene, meshes.sphere(0.13), large, (-0.2, 0.12, 0.95))
    add(scene, meshes.sphere(0.09), small, (0.12, 0.16, 0.8))
    add(scene, meshes.box(0.16, 0.24, 0.16), block, (0.28, 0.01, 1.1), 0.5)
    down = np.array([[1, 0, 0, 0.3], [0, 0, 1, -0.8], [0, -1, 0, 0.9], [0, 0, 0, 1.0]])
    scene.add_light(
        kuafu.Light(kind="rectangle", intensity=(4, 4, 4), ir_intensity=4.0, size_m=(0.4, 0.3), light_to_world=down)
    )
    dots = scene.add_texture((rng.random((240, 424)) < 0.08).astype(np.float32))
    k = [[400, 0, 211.5], [0, 400, 119.5], [0, 0, 1]]
    beside = rigid_motion((0.03, 0, 0))
    scene.add_light(kuafu.Light(kind="projector", texture=dots, k=k, ir_intensity=8.0, light_to_world=beside))
    scene.set_environment((0.3, 0.35, 0.4), 0.3)
    return scene


def error(image, truth):
    return np.sqrt(np.mean((image - truth) ** 2)) / truth.mean()


def has_oidn(renderer, scene, camera):
    try:
        renderer.render(scene, camera, spp=1, denoise="oidn")
    except kuafu.Error:
        return False
    return True


def measure(device, kind, reference_spp):
    scene, renderer = table_top(device, kind), kuafu.Renderer(device)
    k = [[FOCAL_PX, 0, 105.5], [0, FOCAL_PX, 59.5], [0, 0, 1]]
    camera = kuafu.Camera(WIDTH, HEIGHT, k, rigid_motion((0, -0.05, 0)))

    def take(spp, seed, denoise="none"):
        images = renderer.render(scene, camera, ("ambient", "projector_indirect"), spp=spp, seed=seed, denoise=denoise)
        return images["ambient"][0, ..., 0].astype(np.float64) + images["projector_indirect"][0, ..., 0]

    truth = take(reference_spp, 77)
    out = {"truth": truth}
    runs = [("plain 2", 2, "none"), ("plain 32", 32, "none"), ("filtered 2", 2, "atrous")]
    for name, spp, denoise in runs + ([("OIDN 2", 2, "oidn")] if has_oidn(renderer, scene, camera) else []):
        taken = [take(spp, 100 + seed, denoise) for seed in SEEDS]
        out[name] = {"error": np.mean([error(image, truth) for image in taken]), "image": taken[0]}
    return out


def picture(results, path, reference_spp):
    columns = ("plain 2", "plain 32", "filtered 2", "truth")
    figure = Figure(figsize=(4 * len(columns), 2.4 * len(results)), layout="constrained")
    axes = figure.subplots(len(results), len(columns), squeeze=False)
    for row, (kind, result) in zip(axes, results.items()):
        for axis, name in zip(row, columns):
            image = result[name] if name == "truth" else result[name]["image"]
            axis.imshow(np.clip(image, 0, 1) ** (1 / 2.2), cmap="gray", vmin=0, vmax=1)
            axis.set_title(f"{kind}: {name} spp" if name != "truth" else f"{kind}: {reference_spp} spp", fontsize=9)
            axis.axis("off")
    figure.savefig(path, dpi=55, pil_kwargs={"optimize": True})


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", help="where to write before, after and truth")
    parser.add_argument("--reference", type=int, default=4096, help="samples per pixel of the truth")
    arguments = parser.parse_args()
    device = kuafu.Device()
    print(f"{device.info.name}; {WIDTH}x{HEIGHT}, infrared")
    print("| scene | 2 spp | 32 spp | 2 spp filtered | filtered / 32 spp | OIDN / 32 spp |\n|--|--|--|--|--|--|")
    results = {}
    for kind in KINDS:
        r = results[kind] = measure(device, kind, arguments.reference)
        plain, many, filtered = (r[name]["error"] for name in ("plain 2", "plain 32", "filtered 2"))
        oidn = f"{r['OIDN 2']['error'] / many:.2f}" if "OIDN 2" in r else ""
        errors = f"{plain:.4f} | {many:.4f} | {filtered:.4f} | {filtered / many:.2f} | {oidn}"
        print(f"| {kind} | {errors} |", flush=True)
    if arguments.picture:
        picture(results, arguments.picture, arguments.reference)


if __name__ == "__main__":
    main()
