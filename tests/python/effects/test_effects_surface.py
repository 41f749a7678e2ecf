# SPDX-License-Identifier: Apache-2.0
"""Effects of surfaces, and the surfaces of a scene."""

from dataclasses import replace

import numpy as np
import pytest
from activestereo.common.pose import rigid_motion
from activestereo.effects import Light, builtin
from activestereo.effects.core.descriptor import Stage
from activestereo.effects.core.dots import glow
from activestereo.effects.core.laws import example_value, example_view
from activestereo.effects.core.shading import reflected_share
from activestereo.effects.core.surfaces import names_of, numbers_of, scene_surfaces, split_surfaces, surface_names
from activestereo.effects.engines import CaptureRenderer
from activestereo.effects.engines.layers import RenderRequest
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.meshes import box, sphere
from effect_worlds import CAMERA_K, PATTERN, POSE, PROJECTOR_K, SIZE, seen, shift, smooth_places, view_of
from scipy.spatial.transform import Rotation
from virtual_sensor.view import PatternSource, look
from virtual_sensor.world import table_top as world_table_top

import kuafu

EFFECTS = builtin()


def kuafu_plane(device, specular, roughness, size=(96, 64)):
    """A tilted plane before an open sky, under a white projector: (Light, View)."""
    K = np.array([[80.0, 0, 47.5], [0, 80.0, 31.5], [0, 0, 1]])
    scene = kuafu.Scene(device)
    scene.set_environment((1.0, 1.0, 1.0), ir_radiance=1.0)
    corners = np.float32([[-1, -1, 0.9], [1, -1, 0.5], [1, 1, 0.7], [-1, 1, 1.1]])
    mesh = scene.add_mesh(corners, np.uint32([[0, 2, 1], [0, 3, 2]]))
    material = kuafu.Material(ir_albedo=0.4, metallic=0.0, roughness=roughness, specular=specular)
    scene.add_instance(mesh, [scene.add_material(material)])
    white = scene.add_texture(np.ones((64, 96), np.float32))
    projector_K = np.array([[60.0, 0, 47.5], [0, 60.0, 31.5], [0, 0, 1]])
    place = shift(0.03)
    scene.add_light(kuafu.Light(kind="projector", texture=white, k=projector_K, ir_intensity=1.0, light_to_world=place))
    outputs = ("projector_direct", "ambient", "depth", "normal")
    images = kuafu.Renderer(device).render(scene, [kuafu.Camera(*size, K)], outputs, spp=256, seed=3)
    direct, ambient, depth = (images[name][0, ..., 0].astype(np.float64) for name in outputs[:3])
    view = replace(example_view("left"), K=K, projector_K=projector_K, camera_to_projector=shift(-0.03))
    pattern, normal = np.ones((64, 96), np.float32), images["normal"][0].astype(np.float64)
    view = replace(view, depth_m=depth, normal=normal, pattern=pattern)
    return Light(direct, np.zeros_like(direct), ambient, direct), view


@pytest.mark.parametrize("roughness", [0.35, 0.6])
def test_specular_is_the_renderers_own_gloss(device, roughness):
    matt, view = kuafu_plane(device, 0.0, roughness)
    for factor in (0.5, 1.0):
        glossy, _ = kuafu_plane(device, factor, roughness)
        modelled = EFFECTS["specular"](matt, view, factor=factor, roughness=roughness)
        change, left = glossy.direct - matt.direct, glossy.direct - modelled.direct
        assert np.sqrt(np.mean(left**2)) < 0.03 * np.sqrt(np.mean(change**2))
        ambient_change = (glossy.ambient - matt.ambient)[view.depth_m > 0].mean()
        assert (modelled.ambient - matt.ambient)[view.depth_m > 0].mean() == pytest.approx(ambient_change, rel=0.1)


def test_the_lobe_reflects_its_fresnel_share_where_it_is_smooth():
    cosines = np.array([1.0, 0.7, 0.3])
    inside = np.sqrt(1 - (1 - cosines**2) / 1.5**2)
    across = (cosines - 1.5 * inside) / (cosines + 1.5 * inside)
    along = (1.5 * cosines - inside) / (1.5 * cosines + inside)
    np.testing.assert_allclose(reflected_share(cosines, 0.1), (across**2 + along**2) / 2, rtol=0.05)


def test_interreflection_of_minus_one_is_a_world_of_single_reflections():
    bounced, geometry = seen(bounces=1)
    single, _ = seen(bounces=0)
    modelled = EFFECTS["interreflection"](bounced, view_of(geometry), gain=-1.0)
    assert bounced.indirect.max() > 0
    np.testing.assert_array_equal(modelled.indirect, single.indirect)
    np.testing.assert_array_equal(modelled.direct, bounced.direct)


def test_bounced_ambient_light_is_of_the_same_strength():
    view = example_view()
    light = example_value(Stage.SURFACE, view)
    share = np.linspace(0.0, 0.5, view.depth_m.size).reshape(view.shape)
    stronger = EFFECTS["interreflection"](light, replace(view, ambient_bounced=share), gain=2.0)
    np.testing.assert_allclose(stronger.ambient, light.ambient * (1.0 + 2.0 * share))
    unknown = EFFECTS["interreflection"](light, view, gain=2.0)
    np.testing.assert_array_equal(unknown.ambient, light.ambient)


def test_second_projector_is_a_second_source_in_the_world():
    light, geometry = seen(bounces=0)
    view = view_of(geometry)
    offset, yaw = (0.08, 0.03), 0.12
    pose = POSE @ shift(0.015) @ rigid_motion((*offset, 0), Rotation.from_euler("y", yaw).as_matrix())
    source = PatternSource(pose[:3, 3], pose[:3, :3], PROJECTOR_K, PATTERN)
    truth = look(world_table_top(), SIZE, CAMERA_K, POSE @ shift(0.05), source, seed=3, grid=6, bounces=0).direct
    unit = {"intensity_m2": 1.0, "offset_x_m": offset[0], "offset_y_m": offset[1], "yaw_rad": yaw}
    modelled = EFFECTS["second_projector"](light, view, **unit)
    added = modelled.ambient - light.ambient
    # Shadows of the second unit are not modelled, edges mix surfaces.
    here = smooth_places(view.depth_m) & (truth > 0) & (light.flat > 0)
    assert here.mean() > 0.3
    assert np.sqrt(np.mean((added - truth)[here] ** 2)) < 0.3 * truth[here].std()


@pytest.mark.parametrize("core", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("depth_m", [0.5, 1.0])
def test_subsurface_widens_a_dot_by_its_length_on_the_surface(depth_m: float, core: float) -> None:
    view = example_view("left")
    view = replace(view, K=view.K * np.array([[5, 1, 1], [1, 5, 1], [1, 1, 1]]), depth_m=np.full(view.shape, depth_m))
    u, v = view.pixels()
    dot = np.exp(-((u - 48) ** 2 + (v - 36) ** 2) / (2 * 1.5**2))
    light = Light(dot, 0 * dot, 0 * dot, np.ones_like(dot))
    seen_dot = EFFECTS["subsurface"](light, view, fraction=1.0, length_m=0.004, core=core).direct
    width = np.sqrt((seen_dot * (u - 48) ** 2).sum() / seen_dot.sum())
    assert width == pytest.approx(np.hypot(1.5, view.K[0, 0] * 0.004 / depth_m), rel=0.02)
    assert seen_dot.sum() == pytest.approx(dot.sum(), rel=1e-3)


def test_subsurface_without_a_core_falls_off_exponentially_from_where_light_enters() -> None:
    view = example_view("left")
    view = replace(view, K=view.K * np.array([[15, 1, 1], [1, 15, 1], [1, 1, 1]]), depth_m=np.full(view.shape, 0.5))
    length_px = view.K[0, 0] * 0.004 / 0.5
    u, v = view.pixels()
    dot = ((u == 48) & (v == 36)).astype(np.float64)
    light = Light(dot, 0 * dot, 0 * dot, np.ones_like(dot))
    spread = EFFECTS["subsurface"](light, view, fraction=1.0, length_m=0.004, core=0.0).direct
    away = np.hypot(u - 48, v - 36) * np.sqrt(3.0) / length_px
    for radius in (0.7, 1.5, 3.0):
        assert spread[away < radius].sum() == pytest.approx(1.0 - (1.0 + radius) * np.exp(-radius), abs=0.02)


def test_what_is_wholly_transparent_shows_what_is_behind_it_alone():
    view = example_view()
    light = example_value(Stage.SURFACE, view)
    clear = EFFECTS["transmission"](light, view, fraction=1.0, behind=0.7)
    assert clear.projector.max() == 0.0
    np.testing.assert_allclose(clear.ambient, 0.7)


@pytest.mark.parametrize(("extinction", "from_m"), [(0.05, 0.05), (1.0, 0.02)])
def test_the_beams_glow_is_the_sum_of_what_every_piece_of_air_scatters(extinction, from_m):
    wide_K = np.array([[20.0, 0, 99.5], [0, 20.0, 69.5], [0, 0, 1]])
    view = replace(example_view("right"), pattern=np.full((140, 200), 0.6, np.float32), projector_K=wide_K)
    seen_glow = glow(view, extinction, from_m)
    centre = np.linalg.inv(view.camera_to_projector)[:3, 3]
    for row, column in ((36, 48), (8, 80), (60, 12)):
        point = view.points()[row, column]
        steps = np.geomspace(from_m, np.linalg.norm(point), 4001)
        middle = 0.5 * (steps[1:] + steps[:-1])
        way = middle[:, None] * point / np.linalg.norm(point) - centre
        distance = np.linalg.norm(way, axis=1)
        pieces = 0.6 / distance**2 / (4 * np.pi) * np.exp(-extinction * (middle - from_m + distance)) * np.diff(steps)
        assert seen_glow[row, column] == pytest.approx(pieces.sum(), rel=0.02)


def test_smoothing_brings_bounced_light_nearer_to_a_long_render(device, table_top):
    camera = kuafu.Camera(96, 64, np.array([[120.0, 0, 47.5], [0, 120.0, 31.5], [0, 0, 1]]), POSE)
    projector = kuafu.Light(kind="projector", k=PROJECTOR_K, ir_intensity=1.0, light_to_world=camera.camera_to_world)
    request = RenderRequest(table_top, (camera,), projector, PATTERN.astype(np.float32), 32, 4, 1)
    raw, smooth = (CaptureRenderer(device, smooth=s)(request)[0] for s in (False, True))
    reference = CaptureRenderer(device, smooth=False)(replace(request, samples_per_pixel=512, seed=2))[0].indirect
    matt = raw.indirect != smooth.indirect
    assert 0.3 < matt.mean() < 1.0
    raw_error, smooth_error = (np.abs(layers.indirect - reference)[matt].mean() for layers in (raw, smooth))
    assert smooth_error < 0.6 * raw_error, (smooth_error, raw_error)
    assert smooth.indirect.mean() == pytest.approx(raw.indirect.mean(), rel=0.01)
    np.testing.assert_array_equal(smooth.direct, raw.direct)


@pytest.mark.parametrize(
    ("name", "values"),
    [("transmission", {"fraction": 0.5}), ("specular", {"factor": 1.0}), ("subsurface", {"fraction": 0.8})],
)
def test_what_one_surface_shows_leaves_the_others_alone(name, values):
    view = example_view()
    light = example_value(Stage.SURFACE, view)
    everywhere, there = (EFFECTS[name](light, view, **values, surfaces=s) for s in (0.0, 2.0))
    np.testing.assert_array_equal(there.images[:, view.material == 0], light.images[:, view.material == 0])
    np.testing.assert_array_equal(there.images[:, view.material == 1], everywhere.images[:, view.material == 1])
    assert np.abs(there.images - light.images).max() > 0
    unknown = EFFECTS[name](light, replace(view, material=None), **values, surfaces=2.0)
    np.testing.assert_array_equal(unknown.images, everywhere.images)


NAMES = ["paint of ball", "steel", "paint of crate"]


@pytest.fixture(params=["gltf", "glb"])
def path(request, tmp_path):
    """Ball and crate of one paint, a second ball of steel; a child without a mesh before them."""
    writer = GltfWriter()
    paint = writer.add_material("paint", extras={"ir_albedo": 0.6})
    steel = writer.add_material("steel")
    writer.add_light("lamp", (0, 1, 0), (1, 1, 1), 1.0)
    writer.add_mesh("ball", sphere(0.1), paint, (-0.2, 0.0, 0.0))
    writer.add_mesh("crate", box(0.1, 0.1, 0.1), paint, (0.2, 0.0, 0.0))
    writer.add_mesh("weight", sphere(0.1), steel)
    writer.write(tmp_path / f"scene.{request.param}")
    return tmp_path / f"scene.{request.param}"


def test_a_material_of_two_objects_is_two_surfaces_of_a_material_each(path, device):
    assert surface_names(path) == NAMES
    assert [surface.material for surface in scene_surfaces(path)] == [0, 1, 0]
    scene = kuafu.Scene(device)
    with pytest.raises(ValueError, match="the scene has 0 objects, its file 3"):
        split_surfaces(scene, path)
    scene.load(path)
    split_surfaces(scene, path)
    assert [scene.material_name(k) for k in range(scene.summary.material_count)] == NAMES
    assert scene.get_material(2).ir_albedo == pytest.approx(0.6)
    pose = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.8], [0, 0, 0, 1.0]])
    camera = kuafu.Camera(64, 24, [[60, 0, 32], [0, 60, 12], [0, 0, 1]], pose)
    seen = kuafu.Renderer(device).render(scene, [camera], ("material_id", "instance_id"), spp=1)
    pairs = set(zip(seen["instance_id"].ravel().tolist(), seen["material_id"].ravel().tolist(), strict=True))
    found = {(scene.instance_name(i), material) for i, material in pairs if i != 0xFFFFFFFF}
    assert found == {("ball", 0), ("crate", 2), ("weight", 1)}


def test_a_whole_material_has_its_own_name(path):
    assert names_of([0, 2], NAMES) == ("paint",)
    assert names_of([0, 1], NAMES) == ("paint of ball", "steel")
    assert numbers_of("paint", NAMES) == [0, 2]
    assert numbers_of("paint of crate", NAMES) == [2]
    assert numbers_of("wood", NAMES) == []


def test_what_cannot_be_read_has_no_surfaces(tmp_path):
    (tmp_path / "scene.gltf").write_text("{")
    assert scene_surfaces(tmp_path / "scene.gltf") == []
    assert scene_surfaces(None) == []
