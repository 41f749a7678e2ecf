# SPDX-License-Identifier: Apache-2.0
"""ManiSkill's environments with active stereo cameras, beside its own raster camera; parallel scenes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mani_skill", reason="the package mani_skill is not installed (pip install mani_skill)")
import gymnasium  # noqa: E402
import mani_skill.envs  # noqa: E402
import sapien  # noqa: E402
import torch  # noqa: E402

from activestereo import StereoDepthSensorConfig  # noqa: E402
from activestereo.scene_io.bodies import BodyPoseError  # noqa: E402
from activestereo.sensor.cuda_memory import CudaError, CudaMemory  # noqa: E402
from activestereo.integrations.mani_skill import ManiSkillWorld, StereoDepthCamera, StereoDepthCameraConfig  # noqa: E402
from cuda_stub import stub_for_torch  # noqa: E402

SIZE = 64


def make(name: str, obs_mode: str, **config: Any) -> Any:
    camera = {"use_stereo_depth": True, "samples_per_pixel": 1, "width": SIZE, "height": SIZE}
    try:
        sapien.render.RenderSystem(sapien.Device("cpu"))
    except RuntimeError as error:
        pytest.skip(f"SAPIEN has no renderer here, which ManiSkill's cameras need: {error}")
    return gymnasium.make(name, obs_mode=obs_mode, sim_backend="physx_cpu", render_backend="cpu", num_envs=1,
                          sensor_configs=camera | config)  # fmt: skip


@pytest.mark.parametrize("name", ["PickCube-v1", "PushCube-v1"])
def test_an_environment_runs_with_our_camera(name: str) -> None:
    env = make(name, "rgb+depth+segmentation")
    obs, _ = env.reset(seed=0)
    camera = env.unwrapped._sensors["base_camera"]
    assert isinstance(camera, StereoDepthCamera) and isinstance(camera.config, StereoDepthCameraConfig)
    data = obs["sensor_data"]["base_camera"]
    assert {n: (v.dtype, tuple(v.shape)) for n, v in data.items()} == {
        "rgb": (torch.uint8, (1, SIZE, SIZE, 3)),
        "depth": (torch.int16, (1, SIZE, SIZE, 1)),
        "segmentation": (torch.int16, (1, SIZE, SIZE, 1)),
    }
    # The SAPIEN camera's pose and K are ours: what ManiSkill hides is hidden, and ids are its own.
    points = surface_points(camera)
    seen = set(np.unique(data["segmentation"].numpy()).tolist())
    known = {
        int(i)
        for s, _ in camera._world._places.values()
        for i in s._objs[0:1]
        for i in [getattr(i, "entity", i).per_scene_id]
    }
    assert seen - {0} <= known and len(seen) > 3
    hidden = {actor._objs[0].per_scene_id for actor in env.unwrapped._hidden_objects}
    assert not seen & hidden
    cube = env.unwrapped.cube if hasattr(env.unwrapped, "cube") else env.unwrapped.obj
    mask = data["segmentation"][0, ..., 0].numpy() == int(cube.per_scene_id[0])
    assert mask.any()
    middle = points[mask].mean(axis=0)
    np.testing.assert_allclose(middle, cube.pose.p[0].numpy(), atol=0.03)
    before = data["rgb"].clone()
    obs, *_ = env.step(env.action_space.sample())
    assert not torch.equal(before, obs["sensor_data"]["base_camera"]["rgb"])
    env.close()


def surface_points(camera: Any) -> np.ndarray:
    """[h, w, 3] in the world, by the true depth and the parameters that ManiSkill gives."""
    params = camera.get_params()
    depth = camera.sensors.get_true_depth()[0].astype(np.float64)
    v, u = np.indices(depth.shape) + 0.5
    rays = np.linalg.inv(params["intrinsic_cv"][0].numpy()) @ np.stack([u.ravel(), v.ravel(), np.ones(u.size)])
    camera_points = (rays * depth.ravel()).T
    extrinsic = params["extrinsic_cv"][0].numpy()
    return ((camera_points - extrinsic[:, 3]) @ extrinsic[:, :3]).reshape(*depth.shape, 3)


def test_point_clouds_stand_where_things_are() -> None:
    env = make("PickCube-v1", "pointcloud", samples_per_pixel=8)
    obs, _ = env.reset(seed=0)
    cloud = obs["pointcloud"]["xyzw"][0].numpy()
    robot_and_things = cloud[cloud[:, 3] > 0][:, :3]
    measured = np.linalg.norm(
        robot_and_things - env.unwrapped._sensors["base_camera"].camera.get_global_pose().p[0].numpy(), axis=1
    )
    near = robot_and_things[(measured > 0.05) & (measured < 0.9)]
    assert len(near) > 100 and np.median(np.abs(near[:, 2])) < 0.15
    env.close()


class FakeStruct:
    """A ManiSkill actor: one entity in each of its scenes, one pose for each."""

    hidden = False

    def __init__(self, entities: list[Any], environments: list[int]) -> None:
        self._objs, self._scene_idxs = entities, torch.tensor(environments)
        raw = np.array([[*e.pose.p, *e.pose.q] for e in entities], np.float32)
        self.pose = SimpleNamespace(raw_pose=torch.from_numpy(raw))


@pytest.fixture
def parallel() -> Any:
    """Three parallel scenes, as a simulation on a GPU has them; the box is not in the second one."""
    scenes, boxes = [], []
    for number in range(3):
        scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
        scenes.append(scene)
        if number == 1:
            continue
        entity = sapien.Entity()
        body = sapien.physx.PhysxRigidDynamicComponent()
        body.attach(sapien.physx.PhysxCollisionShapeBox([0.1, 0.1, 0.1], sapien.physx.PhysxMaterial(0.5, 0.5, 0)))
        entity.add_component(body)
        entity.set_pose(sapien.Pose([0.1 * number, 0, 0]))
        scene.add_entity(entity)
        boxes.append(entity)
    struct = FakeStruct(boxes, [0, 2])
    return SimpleNamespace(
        sub_scenes=scenes,
        actors={"box": struct},
        articulations={},
        device=torch.device("cpu"),
        parallel_in_single_scene=False,
    )


def test_parallel_scenes_are_environments(parallel: Any) -> None:
    world = ManiSkillWorld(parallel, "cpu")
    assert world.count == 3 and world.bodies.names == ["box"]
    assert world.bodies.poses[0, 0, 0, 3] == 0.0 and world.bodies.poses[2, 0, 0, 3] == pytest.approx(0.2)
    assert world.scene.summary.instance_count == 2
    assert world.update() == 0
    parallel.actors["box"].pose.raw_pose[1, 0] = 0.7
    assert world.update() == 1
    assert world.bodies.poses[2, 0, 0, 3] == pytest.approx(0.7)
    parallel.actors["box"].hidden = True
    world.update()
    assert world.scene.summary.instance_count == 0
    parallel.actors["box"].hidden = False
    world.update()
    assert world.scene.summary.instance_count == 2


def test_a_broken_pose_names_environment_and_body(parallel: Any) -> None:
    world = ManiSkillWorld(parallel, "cpu")
    poses = parallel.actors["box"].pose.raw_pose
    poses[0, 0], poses[1, 1] = float("nan"), 0.3
    with pytest.raises(BodyPoseError, match="environment 0, body 'box'"):
        world.update()
    assert world.bodies.poses[2, 0, 1, 3] == pytest.approx(0.3)


class FakeCamera:
    """A SAPIEN camera, as ManiSkill wraps it, at `x` of every environment's world."""

    def __init__(self, count: int) -> None:
        self.raw_pose = torch.zeros((count, 7))
        self.raw_pose[:, 3], self.raw_pose[:, 0] = 1.0, -0.8

    def get_global_pose(self) -> Any:
        return SimpleNamespace(raw_pose=self.raw_pose)

    def get_intrinsic_matrix(self) -> torch.Tensor:
        return torch.tensor([[[40.0, 0.0, 24.0], [0.0, 40.0, 24.0], [0.0, 0.0, 1.0]]])

    def get_model_matrix(self) -> torch.Tensor:
        return self.raw_pose[:, :3].clone()

    get_extrinsic_matrix = get_model_matrix


def cameras_of(parallel: Any, names: list[str], **options: Any) -> list[StereoDepthCamera]:
    parallel.add_camera = lambda **_: FakeCamera(len(parallel.sub_scenes))
    parallel._reset_mask = torch.ones(3)
    place = sapien.Pose()
    configs = [StereoDepthCameraConfig(name, place, 48, 48, fov=1.1, samples_per_pixel=1, device="cpu", **options)
               for name in names]  # fmt: skip
    return [StereoDepthCamera(config, parallel) for config in configs]


def observe(cameras: list[StereoDepthCamera], **modalities: bool) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The observation of all cameras, in ManiSkill's order: parameters, then images."""
    params = [camera.get_params() for camera in cameras]
    for camera in cameras:
        camera.capture()
    return params, [camera.get_obs(**({"rgb": False, "position": False} | modalities)) for camera in cameras]


def test_observations_that_never_left_the_device_have_the_hosts_bits(
    parallel: Any, monkeypatch: pytest.MonkeyPatch, stub_cuda: Any
) -> None:
    """Against a stub of CUDA's driver; torch computes on the processor what it else computes on a GPU."""
    modalities = {"rgb": True, "position": True}
    cameras = cameras_of(parallel, ["base"])
    cameras += cameras_of(parallel, ["other"], on_cuda=True)
    world = ManiSkillWorld(parallel, "cpu")
    monkeypatch.setattr(ManiSkillWorld, "for_scene", lambda *_: world)
    taken = stub_for_torch(world.scene.device, stub_cuda, monkeypatch)
    for step in range(3):
        parallel.actors["box"].pose.raw_pose[:, 1] = 0.05 * step
        _, (host, there) = observe(cameras, **modalities)
        for name in ("rgb", "depth", "position", "segmentation"):
            assert there[name].dtype == host[name].dtype and torch.equal(there[name], host[name]), name
        assert len({int(i) for i in host["segmentation"].unique()}) == 2 and host["depth"].any()
        held = [t.data_ptr() for t in there.values()]
        assert not set(held) & {array.__cuda_array_interface__["data"][0] for array in taken}


def test_positions_follow_the_rgb_cameras_lens(parallel: Any) -> None:
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.2)
    config.samples_per_pixel, config.rgb_distortion = 1, (0.3, 0.0, 0.0, 0.0)
    (camera,) = cameras = cameras_of(parallel, ["base"], sensor=config)
    _, (seen,) = observe(cameras, position=True)
    points = camera.sensors.get_pointcloud() * [1000, -1000, -1000]
    assert (points[..., 2] < 0).any()
    np.testing.assert_allclose(seen["position"], points, atol=1.5)


def test_a_simulation_on_cuda_does_without_the_host_where_it_can(
    parallel: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Asked for, what cannot be is an error; else a warning, and observations pass through the host."""
    monkeypatch.setitem(CudaMemory.__init__.__kwdefaults__, "library", "/nowhere/libcuda.so.1")
    (camera,) = cameras_of(parallel, ["base"], on_cuda=True)
    with pytest.raises(CudaError, match="there is no CUDA driver"):
        camera.capture()
    (camera,) = cameras_of(parallel, ["base"])
    world = ManiSkillWorld(parallel, "cpu")
    parallel.device = SimpleNamespace(type="cuda")
    with pytest.warns(UserWarning, match="observations pass through the host: there is no CUDA driver"):
        seen = camera._make_observations(world)
    with pytest.raises(RuntimeError, match="on_cuda=True"):
        seen.sensors.get_cuda("depth")


def test_what_is_not_there_is_said(parallel: Any) -> None:
    parallel.parallel_in_single_scene = True
    with pytest.raises(ValueError, match="side by side"):
        ManiSkillWorld(parallel, "cpu")
    assert mani_skill.envs.sapien_env.StereoDepthCamera is StereoDepthCamera
