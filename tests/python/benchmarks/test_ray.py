# SPDX-License-Identifier: Apache-2.0
"""Frames from a cluster's actors: none is lost and none comes twice, whatever happens to the actors."""

import os
import sys
import time
from collections import deque
from pathlib import Path
from types import SimpleNamespace

import pytest

from activestereo.scene_io import meshes
from activestereo.cli import main
from activestereo.benchmarks.generate import bop
from activestereo.benchmarks.generate.layout import Ranges
from activestereo.benchmarks.generate.ray_actors import StudioActor, frames_of, room_for
from activestereo.benchmarks.generate.run import generate
from activestereo.benchmarks.generate.studio import Settings
from activestereo.scene_io.gltf_writer import GltfWriter


# As Ray's ActorDiedError words it: a first line that says nothing, particulars, the cause.
DIED = """The actor died unexpectedly before finishing this task.
\tclass_name: StudioActor
\tactor_id: 5d5ea2f7c1a2b8f1d9f0c3ab01000000
\tpid: 4242
\tnamespace: 0f6d
\tip: 10.0.0.2
The actor is dead because its worker process has died.
The actor never ran - it was cancelled before it started running."""


class Lost(Exception):
    """FakeRay's error for an actor that is no more."""


class OutOfMemory(Exception):
    """FakeRay's error for an actor that the memory monitor ended; Ray has it apart from the others."""


class Failed(Exception):
    def __init__(self, cause: Exception) -> None:
        self.cause = cause


class FakeRay:
    """Ray's calls in one process. lose: {(actor, its how many-th call): exception}, which gets() raises; the first call
    is begin()."""

    exceptions = SimpleNamespace(
        RayActorError=Lost, ObjectLostError=Lost, NodeDiedError=Lost, OutOfMemoryError=OutOfMemory, RayTaskError=Failed
    )

    def __init__(self, lose: dict[tuple[int, int], Exception]) -> None:
        self.lose, self.pending, self.results = lose, deque(), {}
        self.started, self.killed = 0, []

    def start(self) -> SimpleNamespace:
        number, calls = self.started, iter(range(1000))
        self.started += 1

        def call(*frame: int) -> str:
            key = f"actor {number} call {next(calls)}"
            place = (number, int(key.split()[-1]))
            self.results[key] = self.lose.get(place) or {f"{frame}": bytes(frame)}
            self.pending.append(key)
            return key

        method = SimpleNamespace(remote=call)
        return SimpleNamespace(number=number, begin=method, files=method)

    def wait(self, keys: list[str], num_returns: int) -> tuple[list[str], list[str]]:
        assert num_returns == 1 and set(keys) == set(self.pending)
        return [self.pending.popleft()], []

    def get(self, key: str) -> object:
        if isinstance(self.results[key], Exception):
            raise self.results[key]
        return self.results[key]

    def kill(self, actor: SimpleNamespace) -> None:
        self.killed.append(actor.number)


@pytest.mark.parametrize("lose", [{}, {(0, 1): Lost()}, {(0, 0): Lost(), (1, 2): Lost(), (3, 1): OutOfMemory()}])
def test_each_frame_comes_once(lose: dict[tuple[int, int], Exception]) -> None:
    ray = FakeRay(lose)
    found = list(frames_of(ray, ray.start, 3, range(10)))
    assert sorted(number for number, _ in found) == list(range(10))
    assert all(files == {f"{(number,)}": bytes([number])} for number, files in found)
    assert ray.started == 3 + len(lose) and set(ray.killed) >= {actor for actor, _ in lose}


def node(is_alive: bool = True, **resources: float) -> dict[str, object]:
    return {"Alive": is_alive, "Resources": {"memory": 1e9, **resources}}


def test_no_more_actors_than_fit_on_the_machines() -> None:
    nodes = [node(CPU=3.0), node(CPU=5.0), node(False, CPU=64.0, GPU=8.0), node()]
    assert room_for(nodes, 2, may_have_gpu=True) == (3, {"num_cpus": 2})  # a processor of each is left over
    assert room_for(nodes, 5, may_have_gpu=True) == (1, {"num_cpus": 5})
    for asked, there in ((6, nodes), (1, [node()]), (1, [])):
        text = f"--ray-cpus is {asked}, but the largest machine of Ray's cluster has [05] "
        with pytest.raises(ValueError, match=text):
            room_for(there, asked, may_have_gpu=True)
    nodes += [node(CPU=1.0, GPU=2.0)]
    assert room_for(nodes, 6, may_have_gpu=True) == (2, {"num_gpus": 1})
    assert room_for(nodes, 2, may_have_gpu=False) == (3, {"num_cpus": 2})


def test_an_actor_more_is_not_started_for_nothing() -> None:
    ray = FakeRay({})
    assert len(list(frames_of(ray, ray.start, 8, [5, 7]))) == 2 and ray.started == 2


def test_what_ends_every_actor_ends_the_run() -> None:
    ray = FakeRay({(actor, 1): Lost(DIED) for actor in range(9)})
    cause = "The actor is dead because its worker process has died"
    with pytest.raises(ChildProcessError, match=rf"3 of Ray's actors were lost at frame \d, the last by: {cause}.$"):
        list(frames_of(ray, ray.start, 1, range(5)))
    ray = FakeRay({(actor, 1): OutOfMemory("1 worker was killed\nPID\tCOMMAND\nmore") for actor in range(9)})
    with pytest.raises(ChildProcessError, match="the last by: 1 worker was killed$"):
        list(frames_of(ray, ray.start, 1, range(5)))
    ray = FakeRay({(actor, 0): Lost("no module") for actor in range(9)})
    with pytest.raises(ChildProcessError, match="lost at their start, the last by: no module$"):
        list(frames_of(ray, ray.start, 1, range(5)))


def test_a_fault_of_a_frame_is_the_callers() -> None:
    ray = FakeRay({(1, 1): Failed(ValueError("no such thing"))})
    with pytest.raises(ValueError, match="no such thing"):
        list(frames_of(ray, ray.start, 2, range(5)))
    assert ray.killed  # the others do not go on


def test_a_gpu_that_has_no_number_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", SimpleNamespace(get_gpu_ids=lambda: ["GPU-8f6d"]))
    with pytest.raises(ValueError, match="GPU 'GPU-8f6d' .* numbers in CUDA_VISIBLE_DEVICES, or give --device"):
        StudioActor(Settings(())).files(0)


@pytest.mark.parametrize(
    "given, told",
    [
        (["--ray-cpus", "1"], "--ray-cpus goes with --ray"),
        (["--ray", "auto", "--workers", "1"], "--workers does not go with --ray"),
    ],
)
def test_options_that_would_do_nothing_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], given: list[str], told: str
) -> None:
    assert main(["generate", "none.glb", "--out", str(tmp_path / "out"), *given]) != 0
    text = capsys.readouterr().err
    assert told in text and text.count("\n") == 1 and not (tmp_path / "out").exists()


def test_two_machines_of_which_one_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if os.environ.get("ACTIVESTEREO_FULL") != "1":
        pytest.skip("two nodes of Ray take 20 s of a processor to start: ACTIVESTEREO_FULL=1 runs this")
    ray = pytest.importorskip("ray", reason="the package ray is not installed (pip install ray)")
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    from ray.cluster_utils import Cluster

    writer = GltfWriter("ball")
    writer.add_mesh("ball", meshes.sphere(0.05), writer.add_material("paint"))
    writer.write(tmp_path / "ball.glb")
    settings = Settings(
        (tmp_path / "ball.glb",), sensor="sapien-D435", rgb_size=(96, 72), samples=1, ranges=Ranges(things=(1, 1))
    )
    count, dead_at, seen = 24, 6, []
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    doomed = cluster.add_node(num_cpus=1)
    ray.init(address=cluster.address, log_to_driver=False)
    try:

        def watch(share: float) -> None:
            seen.append(share)
            if len(seen) == dead_at:
                assert not ray.available_resources().get("CPU")  # both have an actor
                cluster.remove_node(doomed, allow_graceful=False)

        start = time.monotonic()
        done = generate(settings, tmp_path / "ray", count, workers=1, progress=watch, ray=("auto", 1))
        print(f"{count} frames on two nodes, one killed after {dead_at}: {time.monotonic() - start:.1f} s")
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert len(seen) == done.made == count and not done.missing
    generate(settings, tmp_path / "alone", count, workers=1)
    files = [
        {str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*") if path.is_file()}
        for out in (tmp_path / "ray", tmp_path / "alone")
    ]
    assert files[0] == files[1]
    assert all(bop.is_done(tmp_path / "ray", number) for number in range(count))
