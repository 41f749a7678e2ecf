# SPDX-License-Identifier: Apache-2.0
"""Frames from a cluster's workers: none is lost and none comes twice, whatever happens to the workers."""

import os
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from activestereo.scene_io import meshes
from activestereo.cli import main
from activestereo.benchmarks.generate import bop
from activestereo.benchmarks.generate.run import frame_files, generate, made_by_ray
from activestereo.benchmarks.generate.studio import Ranges, Settings
from activestereo.scene_io.gltf_writer import GltfWriter


class FakeRay(SimpleNamespace):
    """Ray's calls in one process. found: {frame: its files, or get()'s error}; asked: remote()'s options."""

    exceptions = SimpleNamespace(RayError=OSError, RayTaskError=type("Failed", (OSError,), {}))

    def remote(self, **options):
        self.asked = options
        return lambda function: SimpleNamespace(remote=lambda settings, number: number)

    def get(self, number):
        if isinstance(self.found[number], Exception):
            raise self.found[number]
        return self.found[number]


def made(monkeypatch, out, numbers, cpus, machines, **found):
    """(the frames that made_by_ray() yields, Ray's options) on machines of these resources."""
    fake = FakeRay(
        found={number: found.get(f"frame_{number}", {".frames/x": bytes([number])}) for number in numbers},
        is_initialized=lambda: True, nodes=lambda: [{"Alive": bool(own), "Resources": own} for own in machines],
        put=lambda settings: settings, wait=lambda waiting, num_returns: (waiting[-1:], waiting[:-1]),
    )  # fmt: skip
    monkeypatch.setitem(sys.modules, "ray", fake)
    return list(made_by_ray(Settings(()), out, numbers, "auto", cpus)), fake.asked


@pytest.mark.parametrize(
    "machines, needs",
    [([{"CPU": 3.0}, {}], {"num_cpus": 2}), ([{"CPU": 1.0}, {"CPU": 1.0, "GPU": 2.0}], {"num_gpus": 1})],
)
def test_each_frame_comes_once_from_a_gpu_or_from_processors(monkeypatch, tmp_path, machines, needs):
    numbers, asked = made(monkeypatch, tmp_path, [5, 7, 9], 2, machines)
    assert sorted(numbers) == [5, 7, 9] and asked == {"max_calls": 0, "max_retries": 2, **needs}


def test_more_processors_than_a_machine_has_are_refused(monkeypatch, tmp_path):
    with pytest.raises(ValueError, match="--ray-cpus is 6, but the largest machine of Ray's cluster has 5 "):
        made(monkeypatch, tmp_path, [1], 6, [{"CPU": 5.0}, {"CPU": 3.0}, {}])


def test_what_ends_a_frame_ends_the_run_and_a_gpu_that_has_no_number_is_told(monkeypatch, tmp_path):
    machines = [{"CPU": 1.0}]
    with pytest.raises(ChildProcessError, match="3 of Ray's workers were lost at frame 4, the last by: no memory$"):
        made(monkeypatch, tmp_path, [4], 1, machines, frame_4=OSError("no memory\nPID COMMAND"))
    fault = FakeRay.exceptions.RayTaskError()
    fault.cause = ValueError("no such thing")
    with pytest.raises(ValueError, match="no such thing"):
        made(monkeypatch, tmp_path, [4], 1, machines, frame_4=fault)
    monkeypatch.setitem(sys.modules, "ray", SimpleNamespace(get_gpu_ids=lambda: ["GPU-8f6d"]))
    with pytest.raises(ValueError, match="GPU 'GPU-8f6d' .* numbers in CUDA_VISIBLE_DEVICES, or give --device"):
        frame_files(Settings(()), 0)


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
                assert not ray.available_resources().get("CPU")  # both have a worker
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
