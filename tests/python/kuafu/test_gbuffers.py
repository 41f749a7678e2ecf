# SPDX-License-Identifier: Apache-2.0
"""Renderer.light_gbuffers: laws of warped views and of light, on the host as in Vulkan compute, and bad images."""

from functools import cache

import numpy as np
import pytest

import kuafu
from activestereo.common.pose import rigid_motion
from activestereo.effects.core.shading import base_share, cosines_of, highlight

FOCAL_PX, BASELINE_M, PROJECTOR_M = 100.0, 0.05, 0.03
IMAGES = {"depth": np.float32, "normal": np.float32, "albedo": np.float32, "material": np.uint32}
MATT = {"specular": 0.0, "roughness": 1.0, "ir_albedo": 0.5}


def pose(x_m):
    return rigid_motion((x_m, 0, 0))


@cache
def rendering(tracer):
    """A device and its renderer, which compiles for seconds."""
    device = kuafu.Device("cpu")
    return device, kuafu.Renderer(device, tracer=tracer)


def lit(
    given, looks=MATT, baseline_m=BASELINE_M, ambient=0.0, tracer="auto", outputs=None, falloff=0.0, removed=0,
    right=None, finer=1, **more,
):  # fmt: skip
    """Outputs [2, E, height, width] of one material's surfaces under a projector whose pattern is 1 everywhere, 3 W/sr;
    given, right: images [E, height, width] of the cameras; removed: how many materials were there before; finer: how
    many of the images' pixels are as wide as one of FOCAL_PX."""
    device, renderer = rendering(tracer)
    scene = kuafu.Scene(device)
    for _ in range(removed):
        scene.remove_material(scene.add_material(kuafu.Material(ir_albedo=0.9)))
    scene.add_material(kuafu.Material(**looks))
    pattern = scene.add_texture(np.full((64, 64), 255, np.uint8))
    k = np.array([[10.0, 0, 31.5], [0, 10.0, 31.5], [0, 0, 1]])
    place = pose(PROJECTOR_M)
    scene.add_light(
        kuafu.Light(kind="projector", texture=pattern, k=k, ir_intensity=3.0, falloff=falloff, light_to_world=place)
    )
    n = more.get("supersampling", 1)
    count, height, width = given["depth"].shape[0], *(side // n for side in given["depth"].shape[1:])
    k = [[finer * FOCAL_PX, 0, (width - 1) / 2], [0, finer * FOCAL_PX, (height - 1) / 2], [0, 0, 1]]
    cameras = [kuafu.Camera(width, height, k, camera_to_world=pose(x)) for x in (0.0, baseline_m)]
    found = renderer.light_gbuffers(
        scene, cameras, outputs or ["radiance", "projector_direct", "depth", "projector_visibility"],
        left=buffers(device, given), right=right and buffers(device, right),
        environment_count=count, ambient_radiance=np.full(count, ambient), **more,
    )  # fmt: skip
    return {name: np.array(image).reshape(2, count, height, width) for name, image in found.items()}


def buffers(device, given):
    """The images in the device's memory; all surfaces are of the first material."""
    out = {}
    for name, image in ({"material": np.ones(given["depth"].shape)} | given).items():
        out[name] = kuafu.Buffer(device, 4 * image.size, host_visible=True)
        out[name].write(np.ascontiguousarray(image, IMAGES[name]))
    return out


def wall(*depths_m, shape=(24, 100)):
    """Depth and normals of walls that face the camera, one for each environment."""
    depth = np.repeat(np.array(depths_m, np.float32), np.prod(shape)).reshape(-1, *shape)
    return {"depth": depth, "normal": np.broadcast_to(np.array([0.0, 0.0, -1.0]), (*depth.shape, 3))}


@pytest.mark.parametrize("baseline_m", [0.05, -0.03])
def test_a_tilted_plane_is_warped_into_the_plane_that_the_other_camera_sees(baseline_m):
    """1/z of a plane is affine in the image: 1/z = a + b u seen from baseline_m beside it, u' = u - f B / z."""
    u = np.arange(200.0)
    depth = np.broadcast_to(1.0 / (0.8 + 0.002 * u), (2, 3, 200))
    near = 1.0 / lit({"depth": depth}, baseline_m=baseline_m)["depth"][1]
    slope = 0.002 / (1.0 - FOCAL_PX * baseline_m * 0.002)
    expected = 0.8 + slope * (u + FOCAL_PX * baseline_m * 0.8)
    between = (expected > 0.81) & (expected < 1.19)  # beyond, the border is continued
    assert between.mean() > 0.8
    np.testing.assert_allclose(near[..., between], np.broadcast_to(expected[between], near[..., between].shape), 1e-5)


def test_what_a_near_thing_uncovers_is_continued_from_the_background():
    """A block at 0.5 m before a wall at 1 m: each shifts by f B / z, 10 and 5 px; what is between is not seen."""
    given = wall(1.0)
    given["depth"][..., 40:60] = 0.5
    right = lit(given)["depth"][1, 0, 12]
    np.testing.assert_array_equal(np.flatnonzero(right == 0.5), np.arange(30, 50))
    assert (right[50:] == 1.0).all()
    mirrored = lit(given, baseline_m=-0.05)["depth"][1, 0, 12]
    np.testing.assert_array_equal(np.flatnonzero(mirrored == 0.5), np.arange(50, 70))


def test_a_near_thing_throws_a_shadow_away_from_the_projector():
    """The projector, 3 cm to the right, does not see f B (1/z - 1/z0) of the wall to the left of a block."""
    given = wall(1.0)
    given["depth"][..., 40:60] = 0.5
    seen = lit(given)["projector_visibility"][0, 0, 12]
    np.testing.assert_array_equal(np.flatnonzero(seen == 0.0), np.arange(37, 40))


def light_on_wall(depth_m, row, column, shape=(24, 100)):
    """(unit way to the projector, unit way to the left camera, distance) of a point of a wall."""
    point = np.array([(column - (shape[1] - 1) / 2) / FOCAL_PX, (row - (shape[0] - 1) / 2) / FOCAL_PX, 1.0]) * depth_m
    way = np.array([PROJECTOR_M, 0, 0]) - point
    return way / np.linalg.norm(way), -point / np.linalg.norm(point), np.linalg.norm(way)


def test_a_matt_wall_shines_as_lambert_and_the_square_of_the_distance_say():
    found = lit(wall(0.5, 1.5), falloff=2.0, ambient=0.2)
    laser = found["projector_direct"]
    for n, depth_m in enumerate((0.5, 1.5)):
        to_light, _, distance = light_on_wall(depth_m, 10, 80)
        cosine = -to_light[2]  # at the wall and at the projector, which looks along the same axis
        assert laser[0, n, 10, 80] == pytest.approx(0.5 / np.pi * 3.0 * cosine**3 / distance**2, rel=1e-4)
    alone = lit(wall(0.5, 1.5), ambient=0.2, laser_power=[0.0, 0.0])["radiance"]
    np.testing.assert_allclose(alone, 0.5 * 0.2, rtol=1e-2)  # no part of a wall hides the room


@pytest.mark.parametrize("blur_px", [0.0, 0.5, 1.0])
def test_blurred_dots_have_the_contrast_of_traced_ones(blur_px):
    """Dots of a quarter of a pixel on a wall; without the blur theirs would be 1.2 and 1.5 times the traced ones'."""
    given, device = wall(1.0, shape=(32, 48)), kuafu.Device("cpu")
    scene = kuafu.Scene(device)
    matt = scene.add_material(kuafu.Material(**MATT))
    corners = np.array([[-3, -3, 1], [3, -3, 1], [3, 3, 1], [-3, 3, 1]], np.float32)
    scene.add_instance(scene.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)), [matt])
    dots = scene.add_texture((255 * (np.random.default_rng(0).random((256, 256)) < 0.08)).astype(np.uint8))
    k = np.array([[4 * FOCAL_PX, 0, 127.5], [0, 4 * FOCAL_PX, 127.5], [0, 0, 1]])
    scene.add_light(
        kuafu.Light(kind="projector", texture=dots, k=k, ir_intensity=3.0, light_to_world=pose(PROJECTOR_M))
    )
    k = [[FOCAL_PX, 0, 23.5], [0, FOCAL_PX, 15.5], [0, 0, 1]]
    cameras = [kuafu.Camera(48, 32, k, camera_to_world=pose(x)) for x in (0.0, BASELINE_M)]
    renderer, name = kuafu.Renderer(device), "projector_direct"
    images = (
        renderer.render(scene, cameras, [name], band="infrared", spp=512, max_bounces=0, pixel_blur_px=blur_px),
        renderer.light_gbuffers(scene, cameras, [name], left=buffers(device, given), pixel_blur_px=blur_px),
    )
    traced, found = (np.array(image[name])[0, 4:-4, 8:-8] for image in images)
    assert found.std() == pytest.approx(traced.std(), rel=0.12)


def test_the_projectors_light_is_the_sum_of_its_parts_through_the_optics():
    given = wall(0.6)
    given["depth"][..., 40:60] = 0.4
    names = ["projector_direct", "projector_indirect", "projector"]
    optics = kuafu.Optics(psf_sigma_px=0.8, vignetting_exponent=3.0)
    parts = lit(given, outputs=names, optics=optics)
    assert parts["projector_indirect"].max() > 0.0
    alone = lit(given, outputs=names[2:], optics=optics)["projector"]
    np.testing.assert_allclose(alone, parts["projector"], rtol=1e-5)
    np.testing.assert_allclose(alone, parts["projector_direct"] + parts["projector_indirect"], rtol=1e-5)


def test_gloss_has_a_base_below_a_highlight():
    roughness = 0.4
    found = lit(wall(0.5), {"roughness": roughness, "ir_albedo": 0.5})["projector_direct"]
    to_light, to_camera, distance = light_on_wall(0.5, 12, 52)
    c = cosines_of(np.array([0.0, 0.0, -1.0]), to_light, to_camera)
    f = 0.5 / np.pi * base_share(c.n_l, c.n_v, roughness, 1.0) + highlight(c, roughness)
    assert found[0, 0, 12, 52] == pytest.approx(f * 3.0 * float(c.n_l) / distance**2, rel=0.02)  # both read tables


def test_a_corner_gets_less_of_the_room_and_light_of_its_other_wall():
    """A floor below a camera and a wall behind it, albedo a: at the edge half of the room is seen, and the wall's light
    comes in its place, a geometric series: s / (1 - a (1 - s)) with s = 1/2."""
    width, height = 160, 120
    v = (np.arange(height) - (height - 1) / 2) / FOCAL_PX
    depth = np.minimum(np.where(v > 0, 0.2 / np.maximum(v, 1e-9), np.inf), 0.8)
    given = {"depth": np.broadcast_to(depth[None, :, None], (1, height, width))}
    light = lit(given, ambient=1.0, laser_power=[0.0])["radiance"][0, 0, :, width // 2] / 0.5
    edge = int(np.argmax(depth < 0.8))
    assert light[edge : edge + 2] == pytest.approx(0.5 / (1.0 - 0.5 * 0.5), abs=0.12)
    assert light[10] > 0.85  # far above the floor


def test_a_thing_far_before_a_wall_hides_little_of_its_room():
    """A strip 0.1 m wide, 1 m before a wall, fills 0.1 rad about the normal of the wall beside it: 5 % of its light."""
    given = wall(1.5, shape=(48, 100))
    given["depth"][..., 40:60] = 0.5
    light = lit(given, ambient=1.0, laser_power=[0.0])["radiance"][0, 0] / 0.5
    assert light[24, 30:38].min() > 0.9 and light[24, 62:70].min() > 0.9


def test_lobes_look_as_far_in_finer_images():
    """A metal floor 0.25 m below a camera mirrors a wall of 0.3 of the room's light, up to 1.1 m away."""
    height, floor = 120, {}
    for n in (1, 4):
        v = (np.arange(height * n) - (height * n - 1) / 2) / (n * FOCAL_PX)
        depth = np.minimum(np.where(v > 0, 0.25 / np.maximum(v, 1e-9), np.inf), 1.6)
        given = {"depth": np.broadcast_to(depth[None, :, None], (1, height * n, 40 * n))}
        looks = {"metallic": 1.0, "roughness": 0.1, "ir_albedo": 0.3}
        floor[n] = lit(given, looks, ambient=1.0, laser_power=[0.0], supersampling=n)["radiance"][0, 0, -20:, 20]
    assert floor[1].max() < 0.2
    np.testing.assert_allclose(floor[4], floor[1], rtol=0.1)


def away_from_edges(depth):
    """Whether a pixel and its eight neighbours have one depth."""
    around = np.lib.stride_tricks.sliding_window_view(np.pad(depth, 1, "edge"), (3, 3))
    return np.ptp(around, axis=(2, 3)) == 0.0


@pytest.mark.parametrize(("supersampling", "most"), [(1, 0.6), (2, 0.35), (4, 0.2)])
def test_a_pixel_at_an_edge_gets_the_light_of_both_surfaces_by_their_areas(supersampling, most):
    """Straight edges at all angles between albedos 0.9 and 0.1, by areas; one surface a pixel is off by `sharp`."""
    angles, size, fine = np.linspace(0.0, 2 * np.pi, 24, endpoint=False), 32, 16
    place = (np.arange(size * fine) + 0.5) / fine - size / 2
    along = np.cos(angles)[:, None, None] * place + np.sin(angles)[:, None, None] * place[:, None]
    near = along < np.linspace(-0.5, 0.5, len(angles))[:, None, None]
    share = near.reshape(-1, size, fine, size, fine).mean(axis=(2, 4))
    step = fine // supersampling
    is_near = near[:, step // 2 :: step, step // 2 :: step]
    given = {"depth": np.where(is_near, 0.5, 1.0), "albedo": np.where(is_near, 0.9, 0.1)}
    looks, dark = {"specular": 0.0, "roughness": 1.0}, [0.0] * len(angles)
    room = lit(given, looks, ambient=1.0, laser_power=dark, supersampling=supersampling)
    exact, middle = 0.1 + 0.8 * share, np.where(near[:, fine // 2 :: fine, fine // 2 :: fine], 0.9, 0.1)
    off, sharp = room["radiance"][0] - exact, middle - exact
    mixed = ((share > 0.0) & (share < 1.0))[:, 2:-2, 2:-2]
    off, sharp = (np.sqrt((error[:, 2:-2, 2:-2][mixed] ** 2).mean()) for error in (off, sharp))
    assert off < most * sharp and sharp > 0.15


@pytest.mark.parametrize("tracer", ["auto", "compute"])
@pytest.mark.parametrize("n", [2, 3])
def test_supersampled_light_is_the_mean_of_finer_cameras(n, tracer):
    """A tilted plane behind a block, seen from both cameras; depth is that of the sample in a pixel's middle."""
    depth = np.broadcast_to(1.0 / (1.0 + 0.5 * np.arange(40 * n) / (40 * n)), (1, 16 * n, 40 * n)).copy()
    depth[:, 5 * n : 11 * n, 13 * n - 1 : 21 * n] = 0.5
    names = ["projector_direct", "depth", "projector_visibility"]  # horizons reach as far in imagers' pixels
    own, fine = (
        lit({"depth": depth}, tracer=tracer, outputs=names, **how) for how in ({"supersampling": n}, {"finer": n})
    )
    for name, image in fine.items():
        cells = image.reshape(2, 1, 16, n, 40, n)
        expected = cells[..., n // 2, :, n // 2] if name == "depth" else cells.mean(axis=(3, 5))
        np.testing.assert_allclose(own[name], expected, rtol=1e-4, atol=1e-6, err_msg=name)
    assert 0.0 < np.mean((own["projector_visibility"] > 0.0) & (own["projector_visibility"] < 1.0)) < 0.2


@pytest.mark.parametrize("is_right_given", [False, True])
@pytest.mark.parametrize("baseline_m", [BASELINE_M, -BASELINE_M])
def test_a_matt_point_has_one_radiance_in_both_eyes(is_right_given, baseline_m):
    """Blocks at 0.5 m before a wall at 1 m stand 10 and 5 px aside in the other camera; the last at its border."""
    given, right, aside = wall(1.0), wall(1.0), 5 if baseline_m > 0 else -5
    for first, end in ((30, 45), (60, 64), (90, 100)):
        given["depth"][:, 4:20, first:end] = 0.5
        right["depth"][:, 4:20, first - 2 * aside : end - 2 * aside] = 0.5
    found = lit(given, baseline_m=baseline_m, ambient=1.0, right=right if is_right_given else None)
    row, column = np.indices(right["depth"].shape[1:])
    there = column + np.where(right["depth"][0] == 0.5, 2 * aside, aside)
    inside = (there >= 0) & (there < 100)
    left, seen = row[inside], there[inside]
    sharp, alone = away_from_edges(given["depth"][0]), away_from_edges(right["depth"][0])  # elsewhere pixels show two
    both = (given["depth"][0, left, seen] == right["depth"][0][inside]) & sharp[left, seen] & alone[inside]
    one, other = found["radiance"][0, 0, left, seen], found["radiance"][1, 0][inside]
    assert both.mean() > 0.6 and np.ptp(one[both]) > 0.1
    np.testing.assert_allclose(other[both], one[both], rtol=1e-4)


def test_the_host_and_vulkan_compute_agree():
    random = np.random.default_rng(3)
    depth = 0.6 + 0.2 * np.cumsum(random.normal(0, 0.01, (2, 48, 64)), axis=2)
    depth[:, 10:30, 20:40] -= 0.2
    albedo = random.uniform(0.1, 0.9, depth.shape)
    looks = {"roughness": 0.3, "metallic": 0.3}
    given = {"depth": depth, "albedo": albedo}
    a, b = (lit(given, looks, ambient=0.1, tracer=tracer) for tracer in ("auto", "compute"))
    for name in a:
        near = np.isclose(a[name], b[name], rtol=1e-4, atol=1e-5)
        assert near.mean() > 0.999, name  # a ray may pass an edge on one side or the other


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("depth", np.nan, "depth is nan, expected metres"), ("depth", -1.0, "depth is -1"),
        ("normal", 2.0, "the length of normal is .*, expected unit vectors"),
        ("albedo", 1.5, "albedo is 1.5, expected 0 to 1"), ("material", 2, "material is 2, expected a number below 2"),
        ("material", 0xFFFFFFFF, "material is 4294967295, expected a number below 2"),
    ],
)  # fmt: skip
def test_a_bad_value_is_named_with_its_environment(name, value, words):
    given = {"albedo": np.full((3, 24, 100), 0.5), "material": np.ones((3, 24, 100))} | wall(0.5, 0.5, 0.5)
    given = {name: np.array(image) for name, image in given.items()}
    given[name][1, 5, 7] = given[name][2, 1, 1] = value
    with pytest.raises(ValueError, match=rf"environment 1, pixel \(7, 5\): {words}.*\(and in environments 2\)"):
        lit(given)


def test_materials_are_named_by_ids_that_are_given_once():
    given = wall(0.5)
    named = lit(given | {"material": np.full(given["depth"].shape, 2)}, removed=1)
    np.testing.assert_array_equal(named["projector_direct"], lit(given)["projector_direct"])
    with pytest.raises(ValueError, match="material is 1, expected .* that is there"):
        lit(given, removed=1)


def test_where_nothing_is_the_material_and_the_normal_may_be_any_number():
    given = wall(0.5)
    given["depth"][0, 3:9, 20:40] = 0.0
    is_there = given["depth"] > 0
    odd = {
        "material": np.where(is_there, 1, 0xFFFFFFFF),
        "normal": np.where(is_there[..., None], given["normal"], np.nan),
    }
    for name, image in lit(given | odd, ambient=0.1).items():
        np.testing.assert_array_equal(image, lit(given, ambient=0.1)[name], err_msg=name)


def test_infinite_depth_is_nothing():
    given = wall(0.5)
    given["depth"][0, 4:7, 6:9] = np.inf
    found = lit(given, ambient=0.3)
    assert found["depth"][0, 0, 5, 7] == 0.0 and found["radiance"][0, 0, 5, 7] == np.float32(0.3)
