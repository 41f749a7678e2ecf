# SPDX-License-Identifier: Apache-2.0
"""Makes frames on the machines of a Ray cluster, with an actor for each GPU or, without GPUs, for each group of
processors.

Actors send a frame's files as bytes, and only the calling process writes them. So each frame is written once, even if
actors are lost, and the machines need not share a folder. Frames wait for writing in Ray's object store, which spills
them to disk.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import kuafu
from activestereo.benchmarks.generate import bop
from activestereo.benchmarks.generate.studio import Settings, Studio
from activestereo.common.input_files import read_bytes

_MOST_LOSSES = 3  # actors that end at the same frame, or one after another before they have any


class StudioActor:
    """A Ray actor that makes a data set's frames on one machine. That machine needs activestereo, and the files of the
    settings at the same paths."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._studio: Studio | None = None

    def begin(self) -> None:
        """Does nothing; the call returns once Ray has had room to make the actor."""

    def files(self, number: int) -> dict[str, bytes]:
        """Makes a frame and returns its files, {path below the data set's folder: content}."""
        if self._studio is None:  # not in __init__: its errors look like an actor's end
            import ray

            settings = self._settings
            for name in map(str, ray.get_gpu_ids()[:1]):
                # Ray counts a machine's GPUs as CUDA does; Vulkan has this order, without CUDA_VISIBLE_DEVICES.
                if not name.isdecimal():
                    text = f"Ray gave GPU '{name}' to an actor, which tells not which of the machine's it is"
                    advice = "start the machine's Ray with numbers in CUDA_VISIBLE_DEVICES, or give --device"
                    raise ValueError(f"{text}: {advice}")
                gpus = [info.index for info in kuafu.Device.enumerate() if info.usable and "gpu" in info.kind]
                if int(name) >= len(gpus):
                    raise ValueError(f"Ray gave GPU {name} to an actor, but Vulkan has {len(gpus)} usable ones there")
                settings = replace(settings, device=gpus[int(name)])
            self._studio = Studio(settings)
        with TemporaryDirectory() as folder:
            out = Path(folder)
            bop.write_frame(out, self._studio.make_frame(number))
            return {str(path.relative_to(out)): read_bytes(path) for path in out.rglob("*") if path.is_file()}


def made_by_ray(settings: Settings, out: Path, missing: Sequence[int], address: str, cpus: int) -> Iterator[int]:
    """Makes the missing frames on a Ray cluster and yields the number of each after it is written.

    address: 'auto', HOST:PORT or ray://HOST:PORT of a running cluster. cpus: processors of each actor, if the cluster
    has no GPUs or the settings name a device. Raises ValueError without Ray or if no machine has so many processors,
    ConnectionError without such a cluster, and ChildProcessError if one frame ends several actors."""
    if not missing:
        return
    ray = ray_package()
    was_there = ray.is_initialized()  # such a connection stays
    if not was_there:
        ray.init(address=address, log_to_driver=False, logging_level="ERROR")
    try:
        count, needs = room_for(ray.nodes(), cpus, may_have_gpu=settings.device == "auto")
        actor = ray.remote(StudioActor).options(**needs)
        for number, files in frames_of(ray, lambda: actor.remote(settings), count, missing):
            bop.write_files(out, files)
            yield number
    finally:
        if not was_there:
            ray.shutdown()


def room_for(nodes: Sequence[dict[str, Any]], cpus: int, may_have_gpu: bool) -> tuple[int, dict[str, int]]:
    """Returns (number of actors that fit on the machines, resources of each): a GPU if there are any, else `cpus`
    processors of one machine. nodes: ray.nodes(). Raises ValueError if no machine has `cpus` processors, because Ray
    would wait for one without end."""
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
    """Yields each frame's number and files, in order of arrival, from `count` actors at a time. start(): makes a
    StudioActor. A lost actor is replaced, and its frame goes to the next free one. An exception in a frame's
    computation is raised."""
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
                    place, text = "their start" if number is None else f"frame {number}", str(error).strip()
                    # The most informative line: the first, or the one after an actor's indented details.
                    after = re.search(r"^[ \t].*\n(\S.*)", text, re.MULTILINE)
                    reason = after[1] if after else text.partition("\n")[0]
                    text = f"{_MOST_LOSSES} of Ray's actors were lost at {place}, the last by: {reason}"
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
    """Imports and returns the module ray. Raises ValueError if it is missing."""
    try:
        import ray
    except ImportError as error:
        raise ValueError("--ray needs the package ray, which is missing: pip install ray") from error
    return ray
