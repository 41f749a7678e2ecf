# SPDX-License-Identifier: Apache-2.0
"""Makes a data set with several worker processes, each with its own device, or on a Ray cluster. Ray gives each GPU a
worker, or each group of processors if there are no GPUs. Frames that exist already are skipped.

Ray's workers send a frame's files as bytes, and only the calling process writes them. So each frame is written once,
even if workers are lost, and the machines need not share a folder."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import kuafu
from activestereo.benchmarks.generate import bop
from activestereo.benchmarks.generate.studio import Frame, Settings, Studio, physics, sensor_config, things_of
from activestereo.common.input_files import read_bytes, read_json_object
from activestereo.common.optional import imported
from activestereo.common.processes import MOST_LOSSES, done_in_pools, process_pool
from activestereo.common.progress_bar import Progress, silent
from activestereo.scene_io import usd

_RAY = "ray", "--ray needs the package ray, which is missing: pip install ray", ValueError
_studio: Studio | None = None  # the studio of this worker process or Ray worker


def frame_files(settings: Settings, number: int) -> dict[str, bytes]:
    """Makes a frame in one of Ray's workers and returns its files, {path below the data set's folder: content}. The
    worker's machine needs activestereo, and the files that the settings name at the same paths."""
    global _studio
    if _studio is None:
        for name in map(str, imported(*_RAY).get_gpu_ids()[:1]):
            # Ray counts a machine's GPUs as CUDA does; Vulkan has this order, without CUDA_VISIBLE_DEVICES.
            gpus = _gpus()
            if not name.isdecimal() or int(name) >= len(gpus):
                text = f"Ray gave GPU '{name}' to a worker, whose machine has {len(gpus)} usable ones for Vulkan"
                advice = "start the machine's Ray with numbers in CUDA_VISIBLE_DEVICES, or give --device"
                raise ValueError(f"{text}: {advice}")
            settings = replace(settings, device=gpus[int(name)])
        _studio = Studio(settings)
    with TemporaryDirectory() as folder:
        out = Path(folder)
        bop.write_frame(out, _studio.make_frame(number))
        return {str(path.relative_to(out)): read_bytes(path) for path in out.rglob("*") if path.is_file()}


def made_by_ray(settings: Settings, out: Path, missing: Sequence[int], address: str, cpus: int) -> Iterator[int]:
    """Makes the missing frames on a Ray cluster and yields the number of each after it is written. Ray makes a lost
    worker's frame again.

    address: 'auto', HOST:PORT or ray://HOST:PORT of a running cluster. cpus: processors for each worker, used if the
    cluster has no GPUs or the settings name a device. Raises ValueError without Ray or if no machine has so many
    processors, ConnectionError without such a cluster, and ChildProcessError if one frame ends several workers."""
    if not missing:
        return
    ray = imported(*_RAY)
    was_there = ray.is_initialized()  # such a connection stays
    if not was_there:
        ray.init(address=address, log_to_driver=False, logging_level="ERROR")
    try:
        machines = [node["Resources"] for node in ray.nodes() if node["Alive"]]
        needs: dict[str, int] = {"num_gpus": 1}
        if settings.device != "auto" or not any(own.get("GPU", 0) for own in machines):
            needs = {"num_cpus": cpus}
            largest = max((int(own.get("CPU", 0)) for own in machines), default=0)
            if largest < cpus:  # Ray would wait for such a machine without end
                text = f"--ray-cpus is {cpus}, but the largest machine of Ray's cluster has {largest} processors for it"
                raise ValueError(f"{text}: ask for fewer, or add a larger machine")
        # max_calls=0: a worker stays, with its studio, for further frames.
        task = ray.remote(max_calls=0, max_retries=MOST_LOSSES - 1, **needs)(frame_files)
        shared = ray.put(settings)
        waiting = {task.remote(shared, number): number for number in missing}
        while waiting:
            (ended,), _ = ray.wait(list(waiting), num_returns=1)
            number = waiting.pop(ended)
            try:
                bop.write_files(out, ray.get(ended))
            except ray.exceptions.RayTaskError as error:
                raise error.cause from None
            except ray.exceptions.RayError as error:
                reason = str(error).strip().partition("\n")[0]
                text = f"{MOST_LOSSES} of Ray's workers were lost at frame {number}, the last by: {reason}"
                raise ChildProcessError(text) from error
            yield number
    finally:
        if not was_there:
            ray.shutdown()


@dataclass(frozen=True)
class Done:
    """The result of generate(). made: frames made now. there: frames of this part that existed before. missing: frames
    of other parts that do not exist yet. The rest is known once all frames exist. unseen: things that no frame shows.
    measured: share of surface pixels with a depth. invented: share of depths without a surface or off by more than 5
    %."""

    made: int
    there: int
    missing: int
    seconds: float
    unseen: tuple[Path, ...] = ()
    measured: float = math.nan
    invented: float = math.nan


def generate(
    settings: Settings, out: Path, count: int, workers: int, part: tuple[int, int] = (1, 1),
    progress: Progress = silent, ray: tuple[str, int] | None = None,
) -> Done:  # fmt: skip
    """Makes frames 0 to count - 1 in BOP's format under `out`. part: (k, n) makes the k-th of n parts of them.

    Other parts may run at the same time, also on other machines that share the folder. The process that makes the last
    frame writes the scenes' tables. ray: (address of a Ray cluster, processors for each worker), replaces `workers`.
    USD stages are first written to out/things as .glb. Raises ValueError if `out` has frames of other settings, and
    ChildProcessError if workers are killed repeatedly. Finished frames stay, and the same call continues the work."""
    if settings.layout == "drop":
        physics()  # reports a missing package first
    if ray is not None:
        imported(*_RAY)
    paths, folder = list(settings.things), out / "things"
    for place, path in enumerate(paths):
        if usd.is_usd(path):
            folder.mkdir(parents=True, exist_ok=True)
            paths[place] = folder / f"{path.stem}.glb"
            usd.convert(path, paths[place])
    settings = replace(settings, things=tuple(paths))
    things = things_of(settings, kuafu.Scene(kuafu.Device(settings.device))).things  # its checks come first
    about = description(settings)
    if (out / "dataset.json").exists():
        before = read_json_object(out / "dataset.json")
        for key in about:
            if before.get(key) != json.loads(json.dumps(about[key])):
                text = f"{out} has frames of other settings: {key} was {before.get(key)} and is {about[key]}"
                raise ValueError(f"{text}; choose another folder, or the same settings")
    out.mkdir(parents=True, exist_ok=True)
    bop.write_head(out, things, sensor_config(settings), about)
    number, parts = part
    own = range(number - 1, count, parts)
    missing = [frame for frame in own if not bop.is_done(out, frame)]
    bop.remove_left_over(out, set(missing))
    start = time.monotonic()
    made = _make_frames(settings, out, missing, workers) if ray is None else made_by_ray(settings, out, missing, *ray)
    for count_made, _ in enumerate(made, 1):
        progress(count_made / len(missing))
    seconds = time.monotonic() - start
    others = sum(not bop.is_done(out, frame) for frame in range(count))
    done = Done(len(missing), len(own) - len(missing), others, seconds)
    if others:
        return done
    seen, depths = bop.write_scenes(out, count)
    unseen = tuple(thing.path for thing in things if seen.get(thing.id) == 0)
    measured = depths["px_measured"] / max(1, depths["px_there"])
    return replace(done, unseen=unseen, measured=measured, invented=depths["px_invented"] / max(1, depths["px_found"]))


def description(settings: Settings) -> dict[str, Any]:
    """Returns everything that the frames depend on, as dataset.json stores it."""
    about = asdict(settings)
    del about["device"]
    for name, usual in (("ir_size", None), ("unit_m", 1.0), ("keep_transparent", False)):
        if about[name] == usual:
            del about[name]
    return about | {"things": [path.name for path in settings.things], "rgb_size": list(settings.rgb_size),
                    "ranges": {name: list(pair) for name, pair in about["ranges"].items()}}  # fmt: skip


def _make_frames(settings: Settings, out: Path, missing: list[int], workers: int) -> Iterator[int]:
    """Makes the missing frames and yields the number of each after it is written. If a worker is lost, new workers make
    the remaining frames."""
    if workers == 1 or len(missing) < 2:
        yield from _make_in_process(settings, out, missing)
        return
    # Each pool counts its workers anew, by which they share the GPUs.
    pool = lambda: process_pool(workers, _begin, settings, get_context("spawn").Value("i", 0))  # noqa: E731
    for _, task in done_in_pools(pool, partial(_make, out), missing):
        if isinstance(error := task.exception(), BrokenProcessPool):
            text = f"workers were ended from outside {MOST_LOSSES} times without a frame, perhaps for want of memory"
            raise ChildProcessError(f"{text}; what is done is kept: run the same again") from error
        yield task.result()


def _make_in_process(settings: Settings, out: Path, missing: list[int]) -> Iterator[int]:
    """Makes frames in this process; writes one while the next renders."""
    if not missing:
        return
    studio = Studio(settings)
    with ThreadPoolExecutor(1) as writer:
        written: Future[int] | None = None
        for number in missing:
            frame = studio.make_frame(number)
            if written is not None:
                yield written.result()
            written = writer.submit(_write, out, frame)
        assert written is not None
        yield written.result()


def _write(out: Path, frame: Frame) -> int:
    bop.write_frame(out, frame)
    return frame.number


def _gpus() -> list[int]:
    return [info.index for info in kuafu.Device.enumerate() if info.usable and "gpu" in info.kind]


def _begin(settings: Settings, begun: Any) -> None:
    """Prepares a worker process: makes its Studio. begun: a counter, shared by all workers, of the workers that have
    started; it assigns the GPUs to the workers in turn."""
    global _studio
    with begun.get_lock():
        number, begun.value = begun.value, begun.value + 1
    gpus = _gpus()
    if settings.device == "auto" and gpus:
        settings = replace(settings, device=gpus[number % len(gpus)])
    _studio = Studio(settings)


def _make(out: Path, number: int) -> int:
    """Makes a frame in a worker process, unless a lost one had written it already."""
    assert _studio is not None
    return number if bop.is_done(out, number) else _write(out, _studio.make_frame(number))
