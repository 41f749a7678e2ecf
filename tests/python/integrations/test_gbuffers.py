# SPDX-License-Identifier: Apache-2.0
"""Simulators' own images as GBufferStereo takes them: a ball before a wall, whose depth and normals geometry tells."""

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

    from activestereo.integrations.gbuffers.mujoco import MujocoGBuffers, geom_materials, set_camera

    model = mujoco.MjModel.from_xml_string(MJCF)
    sensor = GBufferStereo(CONFIG, materials=geom_materials(model))
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


def isaac_lab(monkeypatch):
    """Modules with the abstract methods of Isaac Lab 3's renderers, and no others."""

    class BaseRenderer(ABC):
        @property
        def visual_material_writer(self):
            return None

        def initialize(self):
            return

        @abstractmethod
        def supported_output_types(self): ...
        @abstractmethod
        def prepare_stage(self, stage, num_envs): ...
        @abstractmethod
        def create_render_data(self, spec): ...
        @abstractmethod
        def set_outputs(self, render_data, output_data): ...
        @abstractmethod
        def update_transforms(self): ...
        @abstractmethod
        def update_geometries(self): ...
        @abstractmethod
        def update_camera(self, render_data, positions, orientations, intrinsics): ...
        @abstractmethod
        def render(self, render_data): ...
        @abstractmethod
        def read_output(self, render_data, camera_data): ...
        @abstractmethod
        def cleanup(self, render_data): ...

    @dataclass
    class RendererCfg:
        class_type: type = BaseRenderer
        renderer_type: str = "default"

    shared = {"BaseRenderer": BaseRenderer, "RendererCfg": RendererCfg}
    for name, content in (("isaaclab", {}), ("isaaclab.renderers", shared), ("isaaclab.utils", {"configclass": _cfg})):
        module = types.ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "activestereo.integrations.gbuffers.isaac_lab", raising=False)
    from activestereo.integrations.gbuffers import isaac_lab as adapter

    return adapter, BaseRenderer, RendererCfg


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
    rtx = RendererCfg()
    wrist = sensors.CameraCfg(data_types=["rgb", "depth"], renderer_cfg=rtx)
    given = types.SimpleNamespace(scene=types.SimpleNamespace(wrist=wrist, robot="robot"))
    assert recipe(given, "D415", 3) is given
    assert wrist.data_types == ["rgb", "depth", "distance_to_image_plane", "normals", "albedo"]
    assert (wrist.renderer_cfg.source, wrist.renderer_cfg.camera, wrist.renderer_cfg.seed) == (rtx, "D415", 3)
    with pytest.raises(ValueError, match="no camera"):
        recipe(types.SimpleNamespace(scene=types.SimpleNamespace(robot="robot")))


def test_isaac_lab(monkeypatch) -> None:
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

        def supported_output_types(self):
            return {"depth": 1}

        def prepare_stage(self, stage, num_envs):
            calls.append(("prepare_stage", num_envs))

        def create_render_data(self, spec):
            return object()

        def set_outputs(self, render_data, output_data):
            self.outputs = output_data

        def update_transforms(self):
            calls.append("update_transforms")

        def update_geometries(self):
            pass

        def update_camera(self, render_data, positions, orientations, intrinsics):
            calls.append("update_camera")

        def render(self, render_data):
            right, down, forward = (normal[..., n] for n in range(3))
            world = np.stack([-right, -forward, -down], axis=-1)  # a camera that looks along -y has its right at -x
            for name in ("depth", "distance_to_image_plane"):
                self.outputs[name].torch.copy_(torch.from_numpy(depth)[..., None].expand(2, 72, 96, 1))
            self.outputs["normals"].torch.copy_(torch.from_numpy(world).expand(2, 72, 96, 3))
            self.outputs["albedo"].torch.fill_(128)

        def read_output(self, render_data, camera_data):
            calls.append("read_output")

        def cleanup(self, render_data):
            calls.append("cleanup")

    class Proxy:
        def __init__(self, values):
            self.torch = values

    kinds = {"depth": 1, "distance_to_image_plane": 1, "normals": 3}
    output = {name: Proxy(torch.zeros(2, 72, 96, n)) for name, n in kinds.items()}
    output["albedo"] = Proxy(torch.zeros(2, 72, 96, 4, dtype=torch.uint8))
    cfg = adapter.ActiveStereoRendererCfg(source=RendererCfg(class_type=Seeing))
    renderer = cfg.class_type(cfg)
    renderer.initialize()
    renderer.prepare_stage(None, 2)
    assert renderer.supported_output_types() == {"depth": 1} and renderer.visual_material_writer == "writer"
    data = renderer.create_render_data(None)
    renderer.set_outputs(data, output)
    renderer.update_transforms()
    turn = torch.tensor([[0.0, 0.0, -(0.5**0.5), 0.5**0.5]] * 2)  # x, y, z, w: x of the camera along -y
    k = torch.from_numpy(config.ir_intrinsic).expand(2, 3, 3)
    renderer.update_camera(data, Proxy(torch.zeros(2, 3)), Proxy(turn), Proxy(k))
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
    renderer.cleanup(data)
    assert calls[0] == ("prepare_stage", 2) and calls[-2:] == ["read_output", "cleanup"]
    del output["normals"]
    with pytest.raises(ValueError, match=r"data_types lack \['normals'\]"):
        renderer.read_output(data, types.SimpleNamespace(output=output))
