# SPDX-License-Identifier: Apache-2.0
"""Makes a data set with several worker processes, each with its own device. Frames that exist already are skipped."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import kuafu
from activestereo.benchmarks.generate import bop
from activestereo.benchmarks.generate.studio import Frame, Settings, Studio, physics, sensor_config, things_of
from activestereo.common.input_files import read_json_object
from activestereo.common.processes import MOST_LOSSES, done_in_pools, process_pool
from activestereo.common.progress_bar import Progress, silent
from activestereo.scene_io import usd

_studio: Studio | None = None  # the studio of this worker process


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
    progress: Progress = silent,
) -> Done:  # fmt: skip
    """Makes frames 0 to count - 1 in BOP's format under `out`. part: (k, n) makes the k-th of n parts of them.

    Other parts may run at the same time, also on other machines that share the folder. The process that makes the last
    frame writes the scenes' tables. USD stages are first written to out/things as .glb. Raises ValueError if `out` has
    frames of other settings, and ChildProcessError if workers are killed repeatedly. Finished frames stay, and the same
    call continues the work."""
    if settings.layout == "drop":
        physics()  # reports a missing package first
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
    for count_made, _ in enumerate(_make_frames(settings, out, missing, workers), 1):
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


def _begin(settings: Settings, begun: Any) -> None:
    """Prepares a worker process: makes its Studio. begun: a counter, shared by all workers, of the workers that have
    started; it assigns the GPUs to the workers in turn."""
    global _studio
    with begun.get_lock():
        number, begun.value = begun.value, begun.value + 1
    gpus = [info.index for info in kuafu.Device.enumerate() if info.usable and "gpu" in info.kind]
    if settings.device == "auto" and gpus:
        settings = replace(settings, device=gpus[number % len(gpus)])
    _studio = Studio(settings)


def _make(out: Path, number: int) -> int:
    """Makes a frame in a worker process, unless a lost one had written it already."""
    assert _studio is not None
    return number if bop.is_done(out, number) else _write(out, _studio.make_frame(number))
