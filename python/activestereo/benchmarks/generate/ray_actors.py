# SPDX-License-Identifier: Apache-2.0
"""Makes frames on the machines of a Ray cluster, with an actor for each GPU, or for a number of processors.

Actors send the files of a frame as bytes, and only the calling process writes them. So each frame is written once, even
if actors are lost, and the machines need not share a folder. Frames that wait for writing are in Ray's object store,
which spills them to disk.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import kuafu
from activestereo.benchmarks.generate import bop
from activestereo.benchmarks.generate.studio import Settings, Studio

_MOST_LOSSES = 3  # actors that end at the same frame, or one after another before they have any


class StudioActor:
    """Makes frames on one machine of the cluster, which needs activestereo and the files of the settings at the same
    paths."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._studio: Studio | None = None

    def begin(self) -> None:
        """Returns once the actor exists: Ray makes it when there is room."""

    def files(self, number: int) -> dict[str, bytes]:
        """The files of a frame, by path below the data set's folder."""
        if self._studio is None:  # not in __init__: its errors look like an actor's end
            import ray

            own = ray.get_gpu_ids()
            self._studio = Studio(replace(self._settings, device=_gpu(str(own[0]))) if own else self._settings)
        with TemporaryDirectory() as folder:
            bop.write_frame(Path(folder), self._studio.make_frame(number))
            return bop.read_files(Path(folder))


def made_by_ray(settings: Settings, out: Path, missing: Sequence[int], address: str, cpus: int) -> Iterator[int]:
    """Yields the number of each frame after it is written.

    address: 'auto', HOST:PORT or ray://HOST:PORT of a running cluster. cpus: for each actor, if the cluster has no GPUs
    or the settings name a device. Raises ValueError without Ray or if no machine has so many processors,
    ConnectionError without such a cluster, and ChildProcessError if a frame ends one actor after another."""
    if not missing:
        return
    with _cluster(address) as ray:
        count, needs = room_for(ray.nodes(), cpus, may_have_gpu=settings.device == "auto")
        actor = ray.remote(StudioActor).options(**needs)
        for number, files in frames_of(ray, lambda: actor.remote(settings), count, missing):
            bop.write_files(out, files)
            yield number


def room_for(nodes: Sequence[dict[str, Any]], cpus: int, may_have_gpu: bool) -> tuple[int, dict[str, int]]:
    """Number of actors that fit on the machines, and the resources of each: a GPU if there are any, else `cpus`
    processors of one machine. nodes: ray.nodes(). Raises ValueError if no machine has so many processors; Ray would
    wait for one without end."""
    alive = [node["Resources"] for node in nodes if node["Alive"]]
    gpus = sum(int(own.get("GPU", 0)) for own in alive)
    if gpus and may_have_gpu:
        return gpus, {"num_gpus": 1}
    processors = [int(own.get("CPU", 0)) for own in alive]
    largest = max(processors, default=0)
    if largest < cpus:
        text = f"--ray-cpus is {cpus}, but the largest machine of Ray's cluster has {largest} processors for actors"
        raise ValueError(f"{text}: ask for fewer, or add a larger machine")
    return sum(own // cpus for own in processors), {"num_cpus": cpus}


def frames_of(
    ray: Any, start: Callable[[], Any], count: int, numbers: Sequence[int]
) -> Iterator[tuple[int, dict[str, bytes]]]:
    """Yields each frame's number and files, in order of arrival. start(): makes a StudioActor; `count` work at the same
    time. A lost one is replaced, and its frame goes to the next free one; a frame's own exception is raised."""
    waiting, losses, left = deque(numbers), Counter[int | None](), len(numbers)
    errors = ray.exceptions
    lost = (errors.RayActorError, errors.ObjectLostError, errors.NodeDiedError, errors.OutOfMemoryError)
    busy: dict[Any, tuple[Any, int | None]] = {}  # {awaited result: (actor, frame or None)}

    def begin() -> None:
        actor = start()
        busy[actor.begin.remote()] = actor, None

    try:
        for _ in range(min(count, left)):
            begin()
        while left:
            (ended,), _ = ray.wait(list(busy), num_returns=1)
            actor, number = busy.pop(ended)
            try:
                files = ray.get(ended)
            except lost as error:
                losses[number] += 1
                if losses[number] == _MOST_LOSSES:
                    what = "their start" if number is None else f"frame {number}"
                    text = f"{_MOST_LOSSES} of Ray's actors were lost at {what}, the last by: {_reason(error)}"
                    raise ChildProcessError(text) from error
                if number is not None:
                    waiting.appendleft(number)
                ray.kill(actor)  # the memory it held is free for the next
                begin()
                continue
            except errors.RayTaskError as error:
                raise error.cause from None
            if waiting:
                following = waiting.popleft()
                busy[actor.files.remote(following)] = actor, following
            if number is None:
                losses[None] = 0
            else:
                left -= 1
                yield number, files
    finally:
        for actor, _ in busy.values():
            ray.kill(actor)


def ray_package() -> Any:
    """The module ray. Raises ValueError if it is missing."""
    try:
        import ray
    except ImportError as error:
        raise ValueError("--ray needs the package ray, which is missing: pip install ray") from error
    return ray


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
    """The module ray, connected; a connection that there was stays."""
    ray = ray_package()
    if ray.is_initialized():
        yield ray
        return
    ray.init(address=address, log_to_driver=False, logging_level="ERROR")
    try:
        yield ray
    finally:
        ray.shutdown()


def _gpu(name: str) -> int:
    """The number in kuafu's list of the machine's GPU that Ray, which counts as CUDA does, calls by this number; Vulkan
    has the same order, without regard to CUDA_VISIBLE_DEVICES."""
    if not name.isdecimal():
        text = f"Ray gave GPU '{name}' to an actor, which tells not which of the machine's it is"
        raise ValueError(f"{text}: start the machine's Ray with numbers in CUDA_VISIBLE_DEVICES, or give --device")
    gpus = [info.index for info in kuafu.Device.enumerate() if info.usable and "gpu" in info.kind]
    if int(name) >= len(gpus):
        raise ValueError(f"Ray gave GPU {name} to an actor, but Vulkan has {len(gpus)} usable ones there")
    return gpus[int(name)]


def _reason(error: Exception) -> str:
    """The most informative line: the first, or the one after an actor's indented details."""
    text = str(error).strip()
    after = re.search(r"^[ \t].*\n(\S.*)", text, re.MULTILINE)
    return after[1] if after else text.partition("\n")[0]
