# SPDX-License-Identifier: Apache-2.0
"""Light through glass: beside Mitsuba's light tracer (an optional extra: `pip install mitsuba`), and in batches."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import mitsuba_scene
import numpy as np
import pytest
from activestereo.common.pose import rigid_motion
from activestereo.scene_io import meshes, solids
from activestereo.scene_io.bodies import add_mesh
from activestereo.scene_io.meshes import Mesh
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

import kuafu

Array = NDArray[np.float64]
LAMP_Z_M, GLASS_Z_M, CAMERA_Z_M, WALL_HALF_M, ALBEDO = 1.4, 0.7, 0.4, 2.0, 0.02  # light between wall and glass is lost
SIDE_PX, CAMERA_FOV_DEG, PATTERN_PX, PATTERN_FOV_DEG = 96, 90.0, 64, 24.0
IOR = 1.5
SEGMENTS = 160
# Mitsuba's scene, about the glass: its rays leave surfaces by 2e-4 of 1 + their largest coordinate, which would be a
# tenth of a wall of 3 mm.
ENLARGED = 100.0


def creased(*line: tuple[float, float]) -> Mesh:
    return meshes.lathe(list(itertools.pairwise(line)), SEGMENTS)


def ball() -> Mesh:
    line = meshes.arc((0.0, 0.0), 0.06, -90.0, 90.0, 97)
    line[[0, -1], 0] = 0.0
    return meshes.lathe([line], SEGMENTS)


def pane() -> Mesh:
    cube, (c, s) = solids.box(), (np.cos(np.radians(25)), np.sin(np.radians(25)))
    flat = replace(cube, positions=cube.positions * np.array([0.3, 0.3, 0.005], np.float32))
    return solids.turned(flat, np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]))


def wine_glass() -> Mesh:
    line = np.array(
        [(0.0, -0.1), (0.035, -0.1), (0.036, -0.098), (0.02, -0.093), (0.006, -0.085), (0.004, -0.06), (0.004, -0.03),
         (0.008, -0.012), (0.028, 0.004), (0.040, 0.03), (0.042, 0.06), (0.038, 0.095), (0.0372, 0.0965),
         (0.0364, 0.095), (0.0404, 0.06), (0.0384, 0.03), (0.0264, 0.006), (0.012, -0.004), (0.0, -0.007)]
    )  # fmt: skip
    last = len(line) - 1
    round_line = CubicHermiteSpline(np.arange(last + 1), line, np.gradient(line, axis=0))
    smooth = round_line(np.linspace(0, last, 12 * last + 1))
    smooth[:, 0] = np.maximum(smooth[:, 0], 0.0)
    return meshes.lathe([smooth], SEGMENTS)


SHAPES = {
    "ball": ball,
    "cylinder": lambda: creased((0, -0.1), (0.05, -0.1), (0.05, 0.1), (0, 0.1)),
    "bottle": lambda: creased(  # hollow, open above: up its outside, down its inside
        (0, -0.1), (0.05, -0.1), (0.05, 0.1), (0.047, 0.1), (0.047, -0.095), (0, -0.095)
    ),
    "pane": pane,
    "wine glass": wine_glass,
}


def wall() -> Mesh:
    return meshes.sheet((-WALL_HALF_M, -WALL_HALF_M, 0), (2 * WALL_HALF_M, 0, 0), (0, 2 * WALL_HALF_M, 0))


def intrinsics(side_px: int, fov_deg: float) -> Array:
    f = 0.5 * side_px / np.tan(np.radians(fov_deg) / 2)
    return np.array([[f, 0, (side_px - 1) / 2], [0, f, (side_px - 1) / 2], [0, 0, 1.0]])


def downwards(z_m: float) -> Array:
    """Pose at (0, 0, z) that looks at the wall: x right, y down, z forward."""
    return rigid_motion((0, 0, z_m), np.diag((1, -1, -1)))


FLAT = np.ones((PATTERN_PX, PATTERN_PX), np.float32)
# Right and down of the pattern's middle; the wine glass's bowl is above it.
DOTS_PX = {"wine glass": [(4, -8), (-5, -13), (1, -11)]}


def dot(right_px: int, down_px: int) -> NDArray[np.float32]:
    pattern = np.zeros_like(FLAT)
    pattern[PATTERN_PX // 2 + down_px, PATTERN_PX // 2 + right_px] = 1.0
    return pattern


renderer = cache(kuafu.Renderer)  # of a device: it compiles for a second


def ours(device: kuafu.Device, mesh: Mesh | None, pattern: NDArray[np.float32], **options: Any) -> Array:
    scene = kuafu.Scene(device)
    scene.set_environment((0, 0, 0), 0.0)

    def add(mesh: Mesh, material: kuafu.Material, z_m: float) -> None:
        place = rigid_motion((0, 0, z_m))
        scene.add_instance(add_mesh(scene, mesh), [scene.add_material(material)], local_to_world=place)

    add(wall(), kuafu.Material(base_color=(ALBEDO, ALBEDO, ALBEDO, 1.0), specular=0.0), 0.0)
    if mesh is not None:
        add(mesh, kuafu.Material(transmission=1.0, roughness=0.0, ior=IOR), GLASS_Z_M)
    texture = scene.add_texture(np.ascontiguousarray(pattern[..., None]))
    k = intrinsics(PATTERN_PX, PATTERN_FOV_DEG)
    scene.add_light(
        kuafu.Light(kind="projector", intensity=(1, 1, 1), light_to_world=downwards(LAMP_Z_M), texture=texture, k=k)
    )
    camera = kuafu.Camera(SIDE_PX, SIDE_PX, intrinsics(SIDE_PX, CAMERA_FOV_DEG), downwards(CAMERA_Z_M))
    settings: dict[str, Any] = {"spp": 256, "max_bounces": 0, "glass_shadows": "bent"} | options
    image = renderer(device).render(scene, camera, ["radiance"], band="visible", **settings)["radiance"]
    return np.array(image, np.float64)[..., 0].reshape(SIDE_PX, SIDE_PX)


def light_traced(mi: Any, mesh: Mesh | None, pattern: NDArray[np.float32], spp: int) -> Array:
    def height(z_m: float) -> float:
        return ENLARGED * (z_m - GLASS_Z_M)

    def add(mesh: Mesh, bsdf: dict[str, Any], z_m: float) -> Any:
        large = replace(mesh, positions=ENLARGED * mesh.positions)
        return mitsuba_scene.mesh(mi, large, bsdf, rigid_motion((0, 0, height(z_m))))

    k, camera = intrinsics(PATTERN_PX, PATTERN_FOV_DEG), mitsuba_scene.pose(mi, downwards(height(CAMERA_Z_M)))
    scene = {
        "type": "scene",
        "wall": add(wall(), {"type": "diffuse", "reflectance": mitsuba_scene.grey(ALBEDO)}, 0.0),
        "lamp": mitsuba_scene.projector(mi, pattern, k, 1.0, downwards(height(LAMP_Z_M))),
        "sensor": {
            "type": "perspective", "fov": CAMERA_FOV_DEG, "to_world": camera, "near_clip": 1e-3,
            "film": {"type": "hdrfilm", "width": SIDE_PX, "height": SIDE_PX, "rfilter": {"type": "box"}},
        },
        "integrator": {"type": "ptracer", "max_depth": 16, "rr_depth": 100},
    }  # fmt: skip
    if mesh is not None:
        scene["glass"] = add(mesh, {"type": "dielectric", "int_ior": IOR, "ext_ior": 1.0}, GLASS_Z_M)
    rendered = mi.render(mi.load_dict(scene), spp=spp, seed=1)
    return np.array(rendered, np.float64)[..., :3].mean(-1)


@dataclass
class Measured:
    """Ours over theirs, and pixels between a dot of ours and of theirs on the wall."""

    shadow_mean: float
    energy: float
    dots_px: list[float]


def place(image: Array, where: NDArray[np.bool_]) -> Array:
    rows, columns = np.nonzero(where)
    light = image[where]
    return np.array([light @ columns, light @ rows]) / light.sum()


def dot_error_px(mi: Any, device: kuafu.Device, mesh: Mesh, right_px: int, down_px: int, **options: Any) -> float:
    pattern = dot(right_px, down_px)
    our, their = ours(device, mesh, pattern, **options), light_traced(mi, mesh, pattern, 64)
    blurred = sum(np.roll(their, (y, x), (0, 1)) for y in (-1, 0, 1) for x in (-1, 0, 1))
    where = np.asarray(blurred > 0.05 * np.max(blurred))  # what is reflected inside the glass lands elsewhere, faint
    return float(np.linalg.norm(place(our, where) - place(their, where)))


@cache
def bare_walls(device: kuafu.Device, spp: int) -> tuple[Array, Array]:
    """Our wall and the light tracer's, without glass."""
    return ours(device, None, FLAT, spp=64), light_traced(mitsuba(), None, FLAT, spp)


def measure(mi: Any, device: kuafu.Device, shape: str, spp: int = 256, **options: Any) -> Measured:
    mesh = SHAPES[shape]()
    (bare, their_bare), dark = bare_walls(device, spp), ours(device, mesh, FLAT, spp=64, glass_surfaces=0)
    shadow = (bare > 0.5 * bare.max()) & (dark == 0.0)
    lit, their_lit = ours(device, mesh, FLAT, **options) / bare.mean(), light_traced(mi, mesh, FLAT, spp)
    their_lit /= their_bare.mean()
    beside = dark.sum() / bare.mean()  # what meets no glass
    dots = DOTS_PX.get(shape, [(0, 0), (4, 0), (-4, 6), (7, -3)])
    return Measured(
        lit[shadow].mean() / their_lit[shadow].mean(),
        (lit.sum() - beside) / (their_lit.sum() - beside),
        [dot_error_px(mi, device, mesh, *d, **options) for d in dots],
    )


def mitsuba() -> Any:
    mi = pytest.importorskip("mitsuba", reason="Mitsuba 3, the light tracer to compare with, is not installed")
    for variant in ("llvm_ad_rgb", "scalar_rgb"):
        try:
            mi.set_variant(variant)
            mi.load_dict({"type": "sphere"})
            return mi
        except (ImportError, RuntimeError):  # no LLVM library
            continue
    pytest.skip("this Mitsuba has neither llvm_ad_rgb nor scalar_rgb")


@pytest.mark.parametrize("shape", SHAPES)
def test_light_behind_glass_is_the_light_tracers(device: kuafu.Device, shape: str) -> None:
    m = measure(mitsuba(), device, shape)
    assert m.shadow_mean == pytest.approx(1.0, abs=0.03)
    assert m.energy == pytest.approx(1.0, abs=0.05)
    assert max(m.dots_px) < 0.1


BATCH_SIDE_PX = 48


def rendered(
    device: kuafu.Device, beside_m: list[float], neighbour_first: bool, output: str = "radiance", shadows: str = "bent"
) -> tuple[NDArray[np.float32], int]:
    """The image of an environment with a ball and a lamp, beside one with balls of these radii; the device's bytes."""
    scene = kuafu.Scene(device)
    scene.set_environment((0, 0, 0), 0.0)
    grey = scene.add_material(kuafu.Material(base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0))
    glass = scene.add_material(kuafu.Material(transmission=1.0, roughness=0.0, ior=1.5, specular=1.0))
    scene.add_instance(add_mesh(scene, meshes.sheet((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))), [grey])

    def fill(environment: int, radius_m: float, z_m: float) -> None:
        ball = add_mesh(scene, meshes.sphere(radius_m))
        scene.add_instance(ball, [glass], local_to_world=rigid_motion((0, 0, z_m)), environment=environment)
        place = downwards(1.4)
        scene.add_light(kuafu.Light(kind="point", intensity=(1, 1, 1), light_to_world=place, environment=environment))

    own, other = (1, 0) if neighbour_first else (0, 1)
    mine, beside = [(own, 0.06, 0.5)], [(other, radius_m, 0.3) for radius_m in beside_m]
    for one in beside + mine if neighbour_first else mine + beside:
        fill(*one)
    k = np.array([[60.0, 0, (BATCH_SIDE_PX - 1) / 2], [0, 60.0, (BATCH_SIDE_PX - 1) / 2], [0, 0, 1]])
    cameras = [kuafu.Camera(BATCH_SIDE_PX, BATCH_SIDE_PX, k, downwards(0.4))] * 2
    options: dict[str, Any] = {"spp": 16, "max_bounces": 1, "glass_shadows": shadows}
    images = kuafu.Renderer(device).render(scene, cameras, [output], environments=[0, 1], **options)[output]
    return np.array(images[own]), device.allocated_bytes


@pytest.mark.parametrize("neighbour_first", [False, True])
def test_what_stands_in_another_environment_changes_no_bit(neighbour_first: bool) -> None:
    device = kuafu.Device("auto")
    large, _ = rendered(device, [0.08], neighbour_first)
    assert large.max() > 0
    assert np.array_equal(large, rendered(device, [0.002], neighbour_first)[0])
    assert np.array_equal(large, rendered(device, [0.03, 0.05], neighbour_first)[0])


def test_depth_alone_makes_no_room_for_light() -> None:
    device = kuafu.Device("auto")
    bent, straight = (rendered(device, [0.05], False, "depth", shadows)[1] for shadows in ("bent", "straight"))
    assert bent == straight
