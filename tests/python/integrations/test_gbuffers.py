# SPDX-License-Identifier: Apache-2.0
"""Simulators' own images as GBufferStereo takes them: a ball before a wall, whose depth and normals geometry tells."""

import importlib
import runpy
import sys
import types
from abc import ABC, abstractmethod
from dataclasses import MISSING, dataclass
from pathlib import Path

import numpy as np
import pytest

from activestereo import GBufferStereo, StereoDepthSensorConfig
from activestereo.integrations.gbuffers.gazebo import fill_depth, gazebo_gbuffers, image_of
from activestereo.integrations.gbuffers.genesis import genesis_gbuffers
from activestereo.integrations.gbuffers.pinhole import centred, vertical_fov_deg
from activestereo.integrations.gbuffers.sapien import sapien_gbuffers

BALL_M, RADIUS_M, WALL_M = np.array([-0.1, -0.05, 0.8]), 0.15, 1.1  # camera axes
EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
CONFIG = StereoDepthSensorConfig("D435").resized(96, 72, fov=40)
MJCF = """<mujoco><worldbody>
<camera pos="0 0 0" xyaxes="0 -1 0 0 0 1"/>
<geom type="sphere" size=".15" pos=".8 .1 .05" rgba=".8 .3 .3 1"/>
<geom type="box" size=".1 4 4" pos="1.2 0 0" rgba=".4 .5 .5 1"/>
</worldbody></mujoco>"""


def seen_by(k, height, width):
    """Depth [height, width] and normals of the ball and the wall."""
    v, u = np.indices((height, width), dtype=float)
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], axis=-1)
    along, squared = rays @ BALL_M, (rays**2).sum(axis=-1)
    inside = along**2 - squared * (BALL_M @ BALL_M - RADIUS_M**2)
    ball = (along - np.sqrt(np.maximum(inside, 0.0))) / squared
    depth = np.where(inside > 0.0, ball, WALL_M)
    normal = np.where((inside > 0.0)[..., None], (rays * ball[..., None] - BALL_M) / RADIUS_M, [0.0, 0.0, -1.0])
    return depth, normal


def check(sensor, images):
    """Images are the geometry's, and are measured."""
    count, height, width = sensor.shape
    depth, normal = seen_by(sensor.k, height, width)
    found = np.broadcast_to(np.asarray(images["depth"]), sensor.shape)
    for environment in range(count):
        assert (np.abs(found[environment] - depth) < 4e-3).mean() > 0.98
        if "normal" in images:
            cosine = (np.asarray(images["normal"])[environment] * normal).sum(axis=-1)
            assert (cosine > 0.999).mean() > 0.98
    out = sensor(**images)
    for measured, is_valid in zip(out["depth"], out["valid"], strict=True):
        assert is_valid.mean() > 0.4
        assert np.median(np.abs(measured - depth)[is_valid]) < 0.02


def test_newton() -> None:
    newton = pytest.importorskip("newton", reason="the package newton is not installed (pip install newton)")
    import warp as wp

    from activestereo.integrations.gbuffers.newton import NewtonGBuffers

    world = newton.ModelBuilder()
    ball = world.add_body(xform=wp.transform((0.8, 0.1, 0.05), wp.quat_identity()))
    world.add_shape_sphere(ball, radius=RADIUS_M, color=(0.9, 0.6, 0.6))
    builder = newton.ModelBuilder()
    for _ in range(2):
        builder.add_world(world)
    builder.add_shape_box(-1, xform=wp.transform((1.2, 0, 0), wp.quat_identity()), hx=0.1, hy=4, hz=4)
    model = builder.finalize(device="cpu")
    sensor = GBufferStereo(CONFIG, environments=2)
    forward = wp.quat_from_matrix(wp.mat33(0, 0, -1, -1, 0, 0, 0, 1, 0))  # -z along x, y along z
    at = wp.array([wp.transform((0, 0, 0), forward)] * 2, dtype=wp.transformf, device="cpu")
    images = NewtonGBuffers(model, sensor)(model.state(), at)
    check(sensor, images)
    red = images["albedo"][0, 30, 40, 0] / 255.0  # of the ball; its colour is sRGB's
    assert red == pytest.approx(0.9**2.2, abs=0.03)


def test_mujoco_warp() -> None:
    mjw = pytest.importorskip(
        "mujoco_warp", reason="the package mujoco_warp is not installed (pip install mujoco-warp)"
    )
    import mujoco
    import warp as wp

    from activestereo.integrations.gbuffers.mujoco import geom_materials, set_camera
    from activestereo.integrations.gbuffers.mujoco_warp import MujocoWarpGBuffers

    model = mujoco.MjModel.from_xml_string(MJCF)
    sensor = GBufferStereo(CONFIG, environments=2, materials=geom_materials(model))
    set_camera(model, 0, sensor)
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    with wp.ScopedDevice("cpu"):
        on_device, data = mjw.put_model(model), mjw.put_data(model, state, nworld=2)
        context = mjw.create_render_context(model, nworld=2, render_rgb=False, render_depth=True, render_seg=True)
        check(sensor, MujocoWarpGBuffers(context, sensor)(on_device, data))


def test_mujoco() -> None:
    mujoco = pytest.importorskip("mujoco", reason="the package mujoco is not installed (pip install mujoco)")
    is_old = [int(part) for part in mujoco.__version__.split(".")[:2]] < [3, 6]

    from activestereo.integrations.gbuffers.mujoco import MujocoGBuffers, geom_materials, set_camera

    model = mujoco.MjModel.from_xml_string(MJCF)
    sensor = GBufferStereo(CONFIG, materials=geom_materials(model))
    if is_old:
        with pytest.raises(ValueError, match="moves cy the wrong way"):
            set_camera(model, 0, sensor)
        sensor = GBufferStereo(centred(CONFIG), materials=geom_materials(model))
    set_camera(model, 0, sensor)
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    try:
        look = MujocoGBuffers(model, sensor)
    except Exception as error:  # MuJoCo has no error of its own for it
        pytest.skip(f"MuJoCo has no OpenGL here: {error} (MUJOCO_GL=egl)")
    images = look(state)
    assert set(np.unique(images["material"])) == {0, 1}
    check(sensor, images)


def pictures(sensor):
    """The ball and the wall as SAPIEN's shaders write them: x right, y up, z backward."""
    depth, normal = seen_by(sensor.k, *sensor.shape[1:])
    gl = np.array([1.0, -1.0, -1.0])
    full = np.ones((*depth.shape, 4), np.float32)
    position = full.copy()
    position[..., 2] = -depth
    turned = full.copy()
    turned[..., :3] = normal * gl
    return {"Position": position, "Normal": turned, "Albedo": 0.5 * full}


def test_sapien_and_mani_skill() -> None:
    sensor = GBufferStereo(CONFIG)
    names = pictures(sensor)
    component = types.SimpleNamespace(get_picture=lambda name: names[name])
    images = {name: image[None] for name, image in sapien_gbuffers(component).items()}
    check(sensor, images)
    both = types.SimpleNamespace(get_picture=lambda name: [np.stack([names[name]] * 2)])
    check(GBufferStereo(CONFIG, environments=2), sapien_gbuffers(both))
    np.testing.assert_array_equal(names["Normal"], pictures(sensor)["Normal"])  # the simulator's stays as it is


def test_genesis() -> None:
    """The camera's images are of Genesis' shape: (rgb, depth, segmentation, normal), depth of nothing is far."""
    import kuafu

    sensor = GBufferStereo(centred(CONFIG), materials={1: kuafu.Material(ir_albedo=0.5)})
    depth, _ = seen_by(sensor.k, *sensor.shape[1:])
    material = np.ones(depth.shape, np.int64)
    material[:25], depth[:25] = 0, 1e3
    camera = types.SimpleNamespace(render=lambda **asked: (None, depth, material, None))
    images = genesis_gbuffers(camera)
    assert (images["depth"][:25] == 0.0).all()
    out = sensor(**images)
    assert out["valid"].mean() > 0.4


def test_fields_of_view_need_a_principal_point_in_the_middle() -> None:
    with pytest.raises(ValueError, match=r"principal point is \[.*\] px beside the middle.*centred\(config\)"):
        vertical_fov_deg(GBufferStereo(CONFIG))
    fov = np.deg2rad(vertical_fov_deg(GBufferStereo(centred(CONFIG))))
    assert 36.0 / np.tan(fov / 2) == pytest.approx(CONFIG.ir_intrinsic[1, 1])


@dataclass
class RosImage:
    height: int = 0
    width: int = 0
    encoding: str = ""
    is_bigendian: int = 0
    step: int = 0
    data: bytes = b""


@dataclass
class GazeboImage:
    height: int = 0
    width: int = 0
    pixel_format_type: int = 0
    step: int = 0
    data: bytes = b""


@pytest.mark.parametrize("kind", [RosImage, GazeboImage])
def test_gazebo_and_ros_messages(kind) -> None:
    sensor = GBufferStereo(CONFIG)
    truth, _ = seen_by(sensor.k, *sensor.shape[1:])
    message = kind()
    fill_depth(message, truth.astype(np.float32))
    np.testing.assert_array_equal(image_of(message), truth.astype(np.float32))
    bgr = np.full((*truth.shape, 3), [0, 0, 128], np.uint8)
    padded = np.concatenate([bgr.reshape(72, -1), np.zeros((72, 8), np.uint8)], axis=1)
    form = {"encoding": "bgr8"} if kind is RosImage else {"pixel_format_type": 8}
    picture = kind(height=72, width=96, step=96 * 3 + 8, data=padded.tobytes(), **form)
    images = gazebo_gbuffers(message, picture)
    assert (images["albedo"][..., 0] == 128).all()
    check(sensor, images)
    nan = truth.astype(np.float32)
    nan[:3] = np.nan
    fill_depth(message, nan)
    assert (gazebo_gbuffers(message, picture)["depth"][:3] == 0.0).all()
    with pytest.raises(ValueError, match="format 'yuv'" if kind is RosImage else "format 99"):
        image_of(kind(**({"encoding": "yuv"} if kind is RosImage else {"pixel_format_type": 99})))


# isaaclab/renderers/base_renderer.py of Isaac Lab 3 in November 2026: each method's arguments, or a property's value.
ISAAC_LAB = {
    "initialize": "", "close": "", "visual_material_writer": None, "prepare_cameras": "stage spec",
    "supported_output_types": "", "prepare_stage": "stage num_envs", "create_render_data": "spec",
    "set_outputs": "render_data output_data", "update_transforms": "", "update_geometries": "",
    "update_camera": "render_data positions orientations intrinsics",
    "update_camera_intrinsics": "render_data intrinsics parameters", "render": "render_data",
    "render_batch": "render_data", "read_output": "render_data camera_data", "cleanup": "render_data",
}  # fmt: skip


def isaac_lab(monkeypatch):
    """Modules with the methods of Isaac Lab's renderers, and no others. Its own class has no method but these."""

    @dataclass
    class RendererCfg:
        class_type: type | None = None
        renderer_type: str = "default"

        def provides_temporal_camera_data(self, data_type):
            return True

    def method(arguments):
        return property(lambda self: arguments) if arguments is None else abstractmethod(lambda self, *given: None)

    BaseRenderer = type(ABC)("BaseRenderer", (ABC,), {name: method(text) for name, text in ISAAC_LAB.items()})
    shared = {"BaseRenderer": BaseRenderer, "RendererCfg": RendererCfg}
    for name, content in (
        ("isaaclab", {}), ("isaaclab.renderers", shared), ("isaaclab.utils", {}),
        ("isaaclab.utils.configclass", {"configclass": _cfg}),
    ):  # fmt: skip
        module = types.ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "activestereo.integrations.gbuffers.isaac_lab", raising=False)
    # Not "from ... import": the package keeps an earlier test's module, and its torch.
    return importlib.import_module("activestereo.integrations.gbuffers.isaac_lab"), BaseRenderer, RendererCfg


def _cfg(kind):
    """configclass lets a default be missing."""
    for name, value in list(vars(kind).items()):
        if value is MISSING:
            setattr(kind, name, None)
    return dataclass(kind)


def test_the_cameras_of_an_isaac_lab_task_get_the_renderer(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", types.ModuleType("torch"))  # nothing is rendered
    _, _, RendererCfg = isaac_lab(monkeypatch)
    sensors = types.ModuleType("isaaclab.sensors")
    sensors.CameraCfg = type("CameraCfg", (types.SimpleNamespace,), {})
    monkeypatch.setitem(sys.modules, "isaaclab.sensors", sensors)
    recipe = runpy.run_path(str(EXAMPLES / "gbuffers/isaac_lab.py"))["with_stereo_depth"]
    kinds = {name: RendererCfg(renderer_type=name) for name in ("newton_warp", "auto_rtx")}
    wrist, tiled = (sensors.CameraCfg(data_types=["rgb", "depth"], renderer_cfg=kind) for kind in kinds.values())
    given = types.SimpleNamespace(scene=types.SimpleNamespace(wrist=wrist, robot="robot"), tiled_camera=tiled)
    assert recipe(given, "D415", 3, 2) is given
    for cfg, name, launched in ((wrist, "newton_warp", "newton_warp"), (tiled, "auto_rtx", "isaac_rtx")):
        assert cfg.data_types == ["rgb", "depth", "distance_to_image_plane", "normals", "albedo"]
        assert cfg.update_latest_camera_pose
        stereo = cfg.renderer_cfg
        assert (stereo.source, stereo.camera, stereo.seed, stereo.supersampling) == (kinds[name], "D415", 3, 2)
        # Isaac Lab's launcher and Camera go by this name: Kit starts for Isaac RTX alone, "auto_rtx" is replaced.
        assert stereo.renderer_type == launched and stereo.provides_temporal_camera_data("depth")
    with pytest.raises(ValueError, match="no camera"):
        recipe(types.SimpleNamespace(scene=types.SimpleNamespace(robot="robot")))


@pytest.mark.parametrize("supersampling", [1, 2])
def test_isaac_lab(monkeypatch, supersampling) -> None:
    torch = pytest.importorskip("torch", reason="the package torch is not installed (pip install torch)")
    adapter, BaseRenderer, RendererCfg = isaac_lab(monkeypatch)
    config = centred(CONFIG)
    depth, normal = seen_by(config.ir_intrinsic, 72, 96)
    calls = []

    class Seeing(BaseRenderer):
        """Writes into its buffers when it renders, as Newton's does; cameras look along -y, which is x of their own."""

        visual_material_writer = "writer"

        def __init__(self, cfg):
            self.outputs = {}

        def set_outputs(self, render_data, output_data):
            self.outputs = output_data

        def render(self, render_data):
            right, down, forward = (normal[..., n] for n in range(3))
            world = np.stack([-right, -forward, -down], axis=-1)  # a camera that looks along -y has its right at -x
            for name in ("depth", "distance_to_image_plane"):
                self.outputs[name].torch.copy_(torch.from_numpy(depth)[..., None].expand(2, 72, 96, 1))
            self.outputs["normals"].torch.copy_(torch.from_numpy(world).expand(2, 72, 96, 3))
            self.outputs["albedo"].torch.fill_(128)

    for name, arguments in ISAAC_LAB.items():
        if arguments is not None and name not in ("set_outputs", "render"):
            setattr(Seeing, name, lambda self, *given, name=name: calls.append((name, len(given))) or name)
    Seeing.__abstractmethods__ = frozenset()

    class Proxy:
        def __init__(self, values):
            self.torch = values

    kinds = {"depth": 1, "distance_to_image_plane": 1, "normals": 3}
    output = {name: Proxy(torch.zeros(2, 72, 96, n)) for name, n in kinds.items()}
    output["albedo"] = Proxy(torch.zeros(2, 72, 96, 4, dtype=torch.uint8))
    cfg = adapter.ActiveStereoRendererCfg(source=RendererCfg(class_type=Seeing), supersampling=supersampling)
    renderer = cfg.class_type(cfg)
    assert renderer.visual_material_writer == "writer"
    data = object()
    renderer.set_outputs(data, output)
    turn = torch.tensor([[0.0, 0.0, -(0.5**0.5), 0.5**0.5]] * 2)  # x, y, z, w: x of the camera along -y
    k = torch.from_numpy(config.ir_intrinsic).repeat(2, 1, 1)
    own = {"update_camera": (data, Proxy(torch.zeros(2, 3)), Proxy(turn), Proxy(k.clone().fill_(1.0)))}
    passed = {name: arguments.split() for name, arguments in ISAAC_LAB.items() if arguments is not None}
    for name in passed.keys() - {"set_outputs", "render", "read_output"}:  # all reach the source, whatever they return
        answer = getattr(renderer, name)(*own.get(name, passed[name]))
        assert calls[-1] == (name, len(passed[name])) and answer in (name, None)
    own["update_camera"][3].torch.copy_(k)  # as set_intrinsic_matrices() does, without another update_camera()
    seen = {}
    call = GBufferStereo.__call__
    monkeypatch.setattr(
        GBufferStereo,
        "__call__",
        lambda self, **given: call(self, **{k: seen.setdefault(k, v) for k, v in given.items()}),
    )
    renderer.render(data)
    renderer.read_output(data, types.SimpleNamespace(output=output))
    assert (seen["normal"].numpy() * normal).sum(axis=-1).min() > 0.999
    measured = output["depth"].torch[..., 0].numpy()
    assert (measured > 0).mean() > 0.4 and np.median(np.abs(measured - depth)[measured > 0]) < 0.02
    np.testing.assert_allclose(output["distance_to_image_plane"].torch[0, ..., 0], depth, rtol=1e-6)
    assert calls[-1] == ("read_output", 2)
    del output["normals"]
    with pytest.raises(ValueError, match=r"data_types lack \['normals'\]"):
        renderer.read_output(data, types.SimpleNamespace(output=output))
