# SPDX-License-Identifier: Apache-2.0
"""A live SAPIEN scene without SAPIEN's renderer, and SAPIEN's StereoDepthSensor method by method."""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

sapien = pytest.importorskip("sapien", reason="the package sapien is not installed (pip install sapien)")

import sapien.sensor.stereodepth as theirs

import kuafu
from activestereo.sensor.cuda_memory import CudaError, CudaMemory
from activestereo.common.pose import body_pose, look_at
from activestereo.integrations.sapien import ActorBuilder, SapienScene, StereoDepthSensor, StereoDepthSensorConfig
from cuda_stub import stub_for_torch

PAGE = Path(__file__).resolve().parents[3] / "examples/sapien_sensor/README.md"


@pytest.fixture
def scene():
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    yield scene
    for entity in list(scene.entities):  # SAPIEN ends the process if a scene without a renderer goes with its entities
        scene.remove_entity(entity)


def small(model="D435", config_class=theirs.StereoDepthSensorConfig):
    config = config_class(model)
    f = 110.0
    config.rgb_resolution = config.ir_resolution = (160, 120)
    config.rgb_intrinsic = config.ir_intrinsic = np.array([[f, 0, 80.0], [0, f, 60.0], [0, 0, 1]])
    config.max_disp, config.samples_per_pixel, config.max_bounces = 32, 2, 2  # the two latter are ours
    return config


def camera_entity(scene, eye=(-0.7, 0.0, 0.5)):
    entity = sapien.Entity()
    pose = body_pose(look_at(eye, (0, 0, 0.03), (0, 0, 1)))
    entity.set_pose(sapien.Pose(pose.p, pose.q))
    scene.add_entity(entity)
    return entity


def add(scene, name, kind, pose, visual=True, **shape):
    builder = ActorBuilder(scene) if visual else scene.create_actor_builder()
    builder.set_physx_body_type("kinematic")
    builder.set_initial_pose(pose)
    if visual:
        getattr(builder, f"add_{kind}_visual")(material=kuafu.Material(base_color=(0.7, 0.6, 0.5, 1)), **shape)
    getattr(builder, f"add_{kind}_collision")(**shape)
    return builder.build(name)


@pytest.fixture
def mount(scene):
    """A camera's place above a table."""
    add(scene, "table", "box", sapien.Pose([0, 0, -0.02]), half_size=[20, 20, 0.02])
    return camera_entity(scene)


TURNED = [0.9238795, 0.0, 0.0, 0.3826834]  # 45 degrees about z
THINGS = {
    "box": (sapien.Pose([0.1, 0.2, 0.05], TURNED), {"half_size": [0.05, 0.08, 0.05]}),
    "sphere": (sapien.Pose([0.0, 0.0, 0.07]), {"radius": 0.07}),
    "capsule": (sapien.Pose([0.0, -0.2, 0.04], TURNED), {"radius": 0.04, "half_length": 0.06}),
    "cylinder": (sapien.Pose([-0.2, 0.15, 0.05], TURNED), {"radius": 0.05, "half_length": 0.03}),
}


def distance(kind, p, shape):
    """Signed distance of points in the shape's own frame; SAPIEN's capsules and cylinders lie along x."""
    if kind == "box":
        q = np.abs(p) - shape["half_size"]
        return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)
    if kind == "sphere":
        return np.linalg.norm(p, axis=-1) - shape["radius"]
    if kind == "capsule":
        axis = np.clip(p[..., 0], -shape["half_length"], shape["half_length"])
        return np.linalg.norm(p - np.stack([axis, 0 * axis, 0 * axis], -1), axis=-1) - shape["radius"]
    q = np.stack([np.abs(p[..., 0]) - shape["half_length"], np.hypot(p[..., 1], p[..., 2]) - shape["radius"]], -1)
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)


def traced_depth(config, pose):
    """Depth by sphere tracing (Hart 1996), with SAPIEN's pixel centres at + 0.5; and what is seen."""
    to_world = pose.to_transformation_matrix().astype(float)
    width, height = config.rgb_resolution
    v, u = np.mgrid[:height, :width] + 0.5
    k = config.rgb_intrinsic
    rays = np.stack([np.ones_like(u), -(u - k[0, 2]) / k[0, 0], -(v - k[1, 2]) / k[1, 1]], -1)  # depth 1
    length = np.linalg.norm(rays, axis=-1)
    depth, nearest = np.zeros(u.shape), np.full(u.shape, "      table")
    for _ in range(200):
        at = (rays * depth[..., None]) @ to_world[:3, :3].T + to_world[:3, 3]
        far = at[..., 2]  # the table z = 0
        nearest[:] = "table"
        for kind, (place, shape) in THINGS.items():
            inverse = np.linalg.inv(place.to_transformation_matrix().astype(float))
            d = distance(kind, at @ inverse[:3, :3].T + inverse[:3, 3], shape)
            nearest[d < far] = kind
            far = np.minimum(far, d)
        depth += far / length
    return depth, nearest


@pytest.mark.parametrize("visual", [True, False], ids=["records", "collision shapes"])
def test_true_depth_is_that_of_the_shapes(scene, visual):
    mount = camera_entity(scene)
    add(scene, "table", "box", sapien.Pose([0, 0, -0.02]), visual, half_size=[20, 20, 0.02])
    for kind, (pose, shape) in THINGS.items():
        add(scene, kind, kind, pose, visual, **shape)
    config = small()
    sensor = StereoDepthSensor(config, mount)
    sensor.take_picture()
    truth, seen = traced_depth(config, sensor.get_pose())
    error_m = np.abs(sensor.native().get_true_depth() - truth)
    assert set(np.unique(seen)) == {"table", *THINGS}
    for kind in ("table", "box"):  # flat: to 0.01 mm
        assert (error_m < 1e-5)[seen == kind].mean() > 0.97, kind  # but for silhouettes
    for kind in ("sphere", "capsule", "cylinder"):
        assert (error_m < 5e-4)[seen == kind].mean() > 0.95, kind
    ids = sensor.native().get_picture("semantic_id")[..., 0]
    by_id = {e.per_scene_id: e.name for e in scene.entities}
    assert (np.vectorize(by_id.get)(ids) == seen).mean() > 0.98


def test_the_scene_is_followed(scene):
    mount = camera_entity(scene)
    box = add(scene, "box", "box", sapien.Pose([0, 0, 0]), half_size=[0.1, 0.1, 0.1])
    world = SapienScene.for_scene(scene)
    assert SapienScene.for_scene(scene) is world and world.update() == 0
    box.set_pose(sapien.Pose([0.1, 0, 0]))
    assert world.update() == 1
    other = add(scene, "box", "box", sapien.Pose([1, 0, 0]), half_size=[0.1, 0.1, 0.1])
    world.update()
    assert world.bodies.names == ["box", f"box ({other.per_scene_id})"] and world.scene.summary.instance_count == 2
    scene.remove_entity(box)
    world.update()
    assert world.bodies.names == [f"box ({other.per_scene_id})"] and world.scene.summary.instance_count == 1
    assert mount.per_scene_id not in world._names


def test_falling_things_are_seen_where_physics_has_them(scene):
    mount = camera_entity(scene, eye=(-1.0, 0.0, 0.3))
    add(scene, "table", "box", sapien.Pose([0, 0, -0.02]), half_size=[20, 20, 0.02])
    builder = ActorBuilder(scene)
    builder.set_initial_pose(sapien.Pose([0, 0, 0.3]))
    builder.add_box_collision(half_size=[0.1] * 3)
    builder.add_box_visual(half_size=[0.1] * 3, material=[0.8, 0.2, 0.2])
    box = builder.build("box")
    sensor = StereoDepthSensor(small(), mount)
    heights = []
    for _ in range(2):
        sensor.take_picture()
        is_box = sensor.native().get_picture("semantic_id")[..., 0] == box.per_scene_id
        points = sensor.native().get_picture("position")[is_box]
        heights.append((points[:, 2].max(), box.pose.p[2]))
        for _ in range(200):
            scene.step()
    for seen, true in heights:
        assert seen == pytest.approx(true + 0.1, abs=0.01)
    assert heights[1][0] == pytest.approx(0.2, abs=0.01)


def test_results_have_sapiens_types(mount):
    config = small()
    config.rgb_resolution = (170, 130)
    local = sapien.Pose([0.0, 0.0, 0.1])
    sensor = StereoDepthSensor(config, mount, local)
    for method in (sensor.get_rgb, sensor.get_depth, sensor.get_ir, sensor.compute_depth):
        with pytest.raises(RuntimeError, match="call take_picture"):
            method()
    sensor.take_picture()
    with pytest.raises(RuntimeError, match="call compute_depth"):
        sensor.get_depth()
    sensor.compute_depth()
    rgb, depth, (left, right) = sensor.get_rgb(), sensor.get_depth(), sensor.get_ir()
    assert rgb.shape == (130, 170, 3) and rgb.dtype == np.float32 and 0 <= rgb.min() and rgb.max() <= 1
    assert depth.shape == (130, 170) and depth.dtype == np.float32
    assert left.shape == right.shape == (120, 160) and left.dtype == np.float32
    np.testing.assert_allclose(left**2.2, sensor.native().get_ir()[0], atol=1e-5)
    points = sensor.get_pointcloud(with_rgb=True)
    assert points.shape == ((depth > 0).sum(), 6) and sensor.get_pointcloud().shape == (len(points), 3)
    assert isinstance(sensor.get_pose(), sapien.Pose)
    np.testing.assert_allclose(sensor.get_pose().p, (mount.pose * local).p, atol=1e-6)
    sensor.set_local_pose(sapien.Pose())
    np.testing.assert_allclose(sensor.get_pose().p, mount.pose.p, atol=1e-6)
    assert isinstance(sensor.get_config(), theirs.StereoDepthSensorConfig) and sensor.get_config() is not config
    depth[:] = 0  # a copy
    assert sensor.get_depth().any()


def test_a_box_bounds_the_depth(mount):
    sensor = StereoDepthSensor(small(), mount)
    sensor.take_picture(infrared_only=True)
    sensor.compute_depth((60, 40), (40, 30))
    disparity = sensor.native().get_disparity()
    inside = np.zeros_like(disparity, bool)
    inside[40:70, 60:100] = True
    assert (disparity[~inside] < 0).all() and (disparity[inside] > 0).mean() > 0.5
    sensor.compute_depth()
    assert (sensor.native().get_disparity() > 0).mean() > 0.5
    with pytest.raises(ValueError, match="bbox_start and bbox_size come together"):
        sensor.compute_depth((60, 40))


def test_a_mount_that_is_in_no_scene_is_told():
    with pytest.raises(RuntimeError, match="Cannot take picture: sensor is not added to scene"):
        StereoDepthSensor(small(), sapien.Entity()).take_picture()


def test_on_a_device_or_a_clear_no(mount):
    torch = pytest.importorskip("torch", reason="the package torch is not installed (pip install torch)")
    sensor = StereoDepthSensor(small(), mount)
    sensor.take_picture()
    sensor.compute_depth()
    for method in (sensor.get_depth_cuda, sensor.get_rgba_cuda, sensor.get_pointcloud_cuda):
        if torch.cuda.is_available():
            assert method().torch().is_cuda
        else:
            with pytest.raises(RuntimeError, match="torch sees no CUDA device"):
                method()


@pytest.mark.parametrize("rgb_exposure", [None, 0.7])
def test_results_that_never_left_the_device_have_the_hosts_bits(scene, monkeypatch, stub_cuda, rgb_exposure):
    """Against a stub of CUDA's driver; torch computes on the processor what it else computes on a GPU."""
    world = SapienScene(scene, "cpu")
    taken = stub_for_torch(world.scene.device, stub_cuda, monkeypatch)
    mount = camera_entity(scene)
    add(scene, "table", "box", sapien.Pose([0, 0, -0.02]), half_size=[20, 20, 0.02])
    add(scene, "ball", "sphere", sapien.Pose([0.0, 0.0, 0.07]), radius=0.07)
    config = small(config_class=StereoDepthSensorConfig)
    config.rgb_exposure, config.rgb_distortion = rgb_exposure, [0.1, -0.05, 0.001, 0.002, 0.0]
    sensor = StereoDepthSensor(config, mount, on_cuda=True)
    with pytest.raises(RuntimeError, match="call take_picture"):
        sensor.get_depth_cuda()
    for _ in range(3):
        sensor.take_picture()
        sensor.compute_depth()
        rgba = sensor.get_rgba_cuda().torch().numpy()
        np.testing.assert_array_equal(rgba[..., :3], sensor.get_rgb(), strict=True)
        assert (rgba[..., 3] == 1.0).all() and np.ptp(rgba[..., 0]) > 0.1
        depth = sensor.get_depth_cuda()
        np.testing.assert_array_equal(depth.torch().numpy(), sensor.get_depth(), strict=True)
        assert depth.ptr == taken[-1].__cuda_array_interface__["data"][0]  # no copy
        for with_rgb in (False, True):
            points = sensor.get_pointcloud_cuda(with_rgb)
            np.testing.assert_array_equal(points.torch().numpy(), sensor.get_pointcloud(with_rgb), strict=True)
            assert points.shape[0] > 100 and points.strides == [4 * points.shape[1], 4]


def test_a_gpu_that_cuda_does_not_have_is_told(scene, monkeypatch):
    monkeypatch.setitem(CudaMemory.__init__.__kwdefaults__, "library", "/nowhere/libcuda.so.1")
    sensor = StereoDepthSensor(small(), camera_entity(scene), on_cuda=True)
    with pytest.raises(CudaError, match="there is no CUDA driver"):
        sensor.take_picture()


WRONG = [
    ("set_census_window_size", (8, 7)), ("set_census_window_size", (9, 9)), ("set_matching_block_size", (17, 17)),
    ("set_matching_block_size", (7.0, 7)), ("set_penalties", (32, 8)), ("set_penalties", (8, 224)),
    ("set_uniqueness_ratio", (256,)), ("set_uniqueness_ratio", (-1,)), ("set_lr_max_diff", (256,)),
    ("set_lr_max_diff", (1.5,)), ("set_ir_noise", (1.0, 0.0)),
]  # fmt: skip
RIGHT = [
    ("set_census_window_size", (9, 7)), ("set_matching_block_size", (5, 5)), ("set_penalties", (7, 86)),
    ("set_uniqueness_ratio", (255,)), ("set_lr_max_diff", (255,)), ("set_lr_max_diff", (-1,)),
    ("set_ir_noise", (2.0, 1.0)),
    ("set_ir_noise", (0, 0)),
]  # fmt: skip


def test_setters_refuse_what_sapiens_refuse_and_take_the_rest(mount):
    early, late = (StereoDepthSensor(small(), mount) for _ in range(2))
    late.take_picture(infrared_only=True)
    for sensor in (early, late):
        for name, values in WRONG:
            before = vars(sensor.get_config())
            with pytest.raises(TypeError, match="must be"):
                getattr(sensor, name)(*values)
            for field in inspect.signature(getattr(sensor, name)).parameters:
                assert getattr(sensor.get_config(), field) == before[field]
        for name, values in RIGHT:
            getattr(sensor, name)(*values)
            for field, value in zip(inspect.signature(getattr(sensor, name)).parameters, values, strict=True):
                assert getattr(sensor.get_config(), field) == value
    early.take_picture(infrared_only=True)
    for sensor in (early, late):
        sensor.compute_depth()
    assert (
        early.native().engine.parameters["uniqueness_ratio"]
        == late.native().engine.parameters["uniqueness_ratio"]
        == 100
    )
    with pytest.raises(TypeError, match="max_disp must be a whole number from 32 to 1024; given 16"):
        config = small()
        config.max_disp = 16
        StereoDepthSensor(config, mount)


@pytest.mark.parametrize("model", ["D415", "D435"])
def test_configurations_have_the_same_fields_and_defaults(model):
    assert StereoDepthSensorConfig(f"sapien-{model}") == StereoDepthSensorConfig(model)
    ours = StereoDepthSensorConfig(model)  # answers to SAPIEN's names, too
    for name, value in vars(theirs.StereoDepthSensorConfig(model)).items():
        if name == "light_pattern":
            continue  # the page says why
        own = getattr(ours, name)
        if isinstance(value, sapien.Pose):
            np.testing.assert_allclose(
                own.to_transformation_matrix(), value.to_transformation_matrix(), atol=1e-6, err_msg=name
            )
        else:
            np.testing.assert_allclose(own, value, rtol=1e-9, err_msg=name)


def table():
    """{method: says 'same'} of the page."""
    rows = re.findall(r"^\| `(\w+)` \| (same|differs)[^|]*\|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert rows, "the page has no table"
    return dict(rows)


def test_the_pages_table_is_that_of_the_installed_package():
    public = {
        n for n, _ in inspect.getmembers(theirs.StereoDepthSensor, inspect.isfunction) if n == "__init__" or n[0] != "_"
    }
    assert set(table()) == public
    for name in public:
        own, other = (inspect.signature(getattr(c, name)) for c in (StereoDepthSensor, theirs.StereoDepthSensor))
        # Those that are named alone SAPIEN has not.
        ours = [(p.name, p.default) for p in own.parameters.values() if p.kind != p.KEYWORD_ONLY]
        assert ours == [(p.name, p.default) for p in other.parameters.values()], name


class Fake:
    """A substitute for what a renderer of SAPIEN's holds, by name of its class."""

    def __init__(self, **fields):
        self.__dict__.update(fields)


def fake(kind, **fields):
    return type(kind, (Fake,), {})(**fields)


def test_render_shapes_and_materials_where_there_is_a_renderer(scene):
    from activestereo.integrations.sapien.scene import render_parts

    texture = Fake(is_srgb=True, download=lambda: np.full((4, 4, 4), 128, np.uint8))
    material = Fake(
        base_color=[0.5, 0.4, 0.3, 1], emission=[0, 0, 0, 0], metallic=0.2, roughness=0.3, specular=0.5,
        transmission=0, ior=1.45,
        base_color_texture=texture,
    )  # fmt: skip
    part = Fake(
        vertices=np.eye(3), triangles=[[0, 1, 2]], material=material,
        get_vertex_normal=lambda: np.zeros((0, 3)), get_vertex_uv=lambda: np.zeros((3, 2)),
    )  # fmt: skip
    for kind, fields, scale in (
        ("RenderShapeBox", {"half_size": [1, 2, 3]}, [1, 2, 3]), ("RenderShapeSphere", {"radius": 2}, [2, 2, 2]),
        ("RenderShapeCylinder", {"radius": 2, "half_length": 3}, [3, 2, 2]), ("RenderShapeCapsule", {}, [1, 1, 1]),
        ("RenderShapeTriangleMesh", {"scale": [2, 2, 1]}, [2, 2, 1]),
    ):  # fmt: skip
        (found,) = render_parts(fake(kind, parts=[part], **fields))
        np.testing.assert_array_equal(found.scale, scale, err_msg=kind)
        assert found.arrays.keys() == {"positions", "indices", "uvs"}
    world = SapienScene(scene)
    first = world.looks.material(material)
    assert world.looks.material(material) == first and world.scene.summary.texture_count == 1
    made = world.scene.get_material(first)
    assert made.specular == pytest.approx(1.0)
    assert made.metallic == pytest.approx(0.2)
    assert made.base_color_texture is not None
