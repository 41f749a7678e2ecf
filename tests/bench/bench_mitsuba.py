# SPDX-License-Identifier: Apache-2.0
"""RGB images on processors beside Mitsuba 3's llvm_ad_rgb, both with the same scene, path depth and samples: seconds of
processor time, noise, and the ratio of what both need for equal noise (time times the square of the noise).

    pip install mitsuba         # 3.9 was tried; DRJIT_LIBLLVM_PATH names an LLVM library of version 16 or later
    PYTHONPATH=build/python python3 tests/bench/bench_mitsuba.py [--spp 64] [--rounds 6]

Mitsuba's sampler is multijitter, its best one here. Noise is the median over pixels of the standard deviation between
rounds over the mean. The means of both images are printed: a ratio says nothing where they differ.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.pose import look_at, rigid_motion
from activestereo.scene_io import meshes
import mitsuba_scene

Image = NDArray[np.float64]
Point = tuple[float, float, float]
WIDTH, HEIGHT = 256, 192
BOUNCES = 8


class Pair:
    """The same scene for both."""

    def __init__(self, mi: Any, side: Point, at: Point) -> None:
        self.mi = mi
        self.scene = kuafu.Scene(kuafu.Device("cpu"))
        self.scene.set_environment((0.0, 0.0, 0.0))
        self.pose = look_at(side, at, (0.0, 1.0, 0.0))
        self.peer: dict[str, Any] = {"type": "scene"}

    def add(self, mesh: meshes.Mesh, own: dict[str, Any], peer: dict[str, Any], at: Point = (0.0, 0.0, 0.0)) -> None:
        place = rigid_motion(at)
        paint = [self.scene.add_material(kuafu.Material(**own))]
        number = self.scene.add_mesh(mesh.positions, mesh.indices, normals=mesh.normals)
        self.scene.add_instance(number, paint, local_to_world=place)
        self.peer[f"shape{len(self.peer)}"] = mitsuba_scene.mesh(self.mi, mesh, peer, place)

    def add_panel(self, at: Point, towards: Point, size_m: float, radiance: float) -> None:
        pose = look_at(at, towards, (0.0, 0.0, 1.0))
        light = kuafu.Light(kind="rectangle", intensity=(radiance,) * 3, light_to_world=pose, size_m=(size_m, size_m))
        self.scene.add_light(light)
        place = mitsuba_scene.pose(self.mi, pose) @ self.mi.ScalarTransform4f().scale([0.5 * size_m, 0.5 * size_m, 1.0])
        emitter = {"type": "area", "radiance": rgb(radiance)}
        self.peer["panel"] = {"type": "rectangle", "to_world": place, "emitter": emitter, "bsdf": diffuse(0.0)}

    def camera(self) -> kuafu.Camera:
        focal = 0.5 * WIDTH / np.tan(np.deg2rad(22.5))
        k = np.array([[focal, 0.0, 0.5 * (WIDTH - 1)], [0.0, focal, 0.5 * (HEIGHT - 1)], [0.0, 0.0, 1.0]])
        return kuafu.Camera(WIDTH, HEIGHT, k, camera_to_world=self.pose)

    def sensor(self, spp: int) -> dict[str, Any]:
        film = {
            "type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"},
            "component_format": "float32", "pixel_format": "rgb",
        }  # fmt: skip
        sampler = {"type": "multijitter", "sample_count": spp}
        return {
            "type": "perspective", "fov": 45.0, "fov_axis": "x", "to_world": mitsuba_scene.pose(self.mi, self.pose),
            "film": film, "sampler": sampler, "near_clip": 1e-3, "far_clip": 1e4,
        }  # fmt: skip


def rgb(*values: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(values if len(values) == 3 else values * 3)}


def diffuse(*values: float) -> dict[str, Any]:
    return {"type": "twosided", "side": {"type": "diffuse", "reflectance": rgb(*values)}}


def matt(*values: float) -> dict[str, Any]:
    return {"base_color": (*(values if len(values) == 3 else values * 3), 1.0), "specular": 0.0}


def room(mi: Any) -> Pair:
    """Light from a panel under the ceiling of a box with coloured walls (area-lit, all matt)."""
    pair = Pair(mi, (0.0, 1.0, 3.7), (0.0, 1.0, 0.0))
    white, red, green = (0.73,), (0.63, 0.06, 0.05), (0.14, 0.45, 0.09)
    for origin, u, v, paint in (
        ((-1, 0, 1), (2, 0, 0), (0, 0, -2), white), ((-1, 2, -1), (2, 0, 0), (0, 0, 2), white),
        ((-1, 0, -1), (2, 0, 0), (0, 2, 0), white), ((-1, 0, 1), (0, 0, -2), (0, 2, 0), red),
        ((1, 0, -1), (0, 0, 2), (0, 2, 0), green),
    ):  # fmt: skip
        pair.add(meshes.sheet(origin, u, v), matt(*paint), diffuse(*paint))
    for size, x, z in ((1.2, -0.35, -0.3), (0.6, 0.35, 0.3)):
        pair.add(meshes.box(0.6, size, 0.6), matt(*white), diffuse(*white), (x, 0.0, z))
    pair.add_panel((0.0, 1.999, 0.0), (0.0, 0.0, 0.0), 0.5, 15.0)
    return pair


def table(mi: Any) -> Pair:
    """Balls of rough metal, glass and plastic under a panel."""
    pair = Pair(mi, (0.0, 1.2, 3.2), (0.0, 0.45, 0.0))
    pair.add(meshes.sheet((-3, 0, 3), (6, 0, 0), (0, 0, -6)), matt(0.6, 0.5, 0.4), diffuse(0.6, 0.5, 0.4))
    pair.add(meshes.sheet((-3, 0, -2), (6, 0, 0), (0, 3, 0)), matt(0.5), diffuse(0.5))
    metal = {"type": "principled", "base_color": rgb(0.9, 0.6, 0.3), "metallic": 1.0, "roughness": 0.4}
    own_metal = {"base_color": (0.9, 0.6, 0.3, 1.0), "metallic": 1.0, "roughness": 0.4}
    glass = {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}
    own_glass = {"transmission": 1.0, "roughness": 0.0, "ior": 1.5}
    plastic = {
        "type": "roughplastic", "distribution": "ggx", "alpha": 0.09, "int_ior": 1.5, "ext_ior": 1.0,
        "diffuse_reflectance": rgb(0.2, 0.3, 0.7),
    }  # fmt: skip
    own_plastic = {"base_color": (0.2, 0.3, 0.7, 1.0), "roughness": 0.3}
    for x, z, radius, own, peer in (
        (-0.9, 0.0, 0.45, own_metal, metal), (0.0, 0.3, 0.4, own_glass, glass), (0.9, 0.0, 0.45, own_plastic, plastic),
    ):  # fmt: skip
        pair.add(meshes.sphere(radius), own, peer, (x, 0.45, z))
    pair.add_panel((1.5, 3.0, 1.5), (0.0, 0.0, 0.0), 1.0, 8.0)
    return pair


def measure(render: Callable[[int], Image], rounds: int) -> tuple[float, float, float]:
    """(processor seconds of the quickest render, noise, mean) after one render that does not count."""
    render(0)
    images, seconds = [], []
    for seed in range(rounds):
        start = time.process_time()
        images.append(render(seed + 1))
        seconds.append(time.process_time() - start)
    grey = np.stack(images).mean(axis=-1)
    mean, spread = grey.mean(axis=0), grey.std(axis=0, ddof=1)
    return min(seconds), float(np.median(spread / np.maximum(mean, 0.02 * mean.max()))), float(mean.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=6)
    options = parser.parse_args()
    try:
        import mitsuba as mi
    except ImportError:
        raise SystemExit("skipped: Mitsuba is not installed (pip install mitsuba)") from None
    mi.set_variant("llvm_ad_rgb")
    print("| scene | kuafu, s | noise | mean | Mitsuba, s | noise | mean | time for equal noise, kuafu / Mitsuba |")
    print("|--|--|--|--|--|--|--|--|")
    for make in (room, table):
        pair = make(mi)
        renderer, camera = kuafu.Renderer(pair.scene.device), pair.camera()
        integrator = {"type": "path", "max_depth": BOUNCES + 2, "rr_depth": 4}
        scene = mi.load_dict(pair.peer | {"sensor": pair.sensor(options.spp), "integrator": integrator})

        def ours(seed: int, p: Pair = pair, r: kuafu.Renderer = renderer, c: kuafu.Camera = camera) -> Image:
            out = r.render(p.scene, c, band="visible", spp=options.spp, max_bounces=BOUNCES, seed=seed)["radiance"]
            return np.asarray(out, np.float64).reshape(HEIGHT, WIDTH, 3)

        def peers(seed: int, s: Any = scene) -> Image:
            return np.asarray(mi.render(s, spp=options.spp, seed=seed), np.float64)

        (a, noise, mean), (b, peer_noise, peer_mean) = measure(ours, options.rounds), measure(peers, options.rounds)
        ratio = a * noise**2 / (b * peer_noise**2)
        own, peer = f"{a:.2f} | {noise:.4f} | {mean:.4f}", f"{b:.2f} | {peer_noise:.4f} | {peer_mean:.4f}"
        print(f"| {make.__name__} | {own} | {peer} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
