# SPDX-License-Identifier: Apache-2.0
"""Takes the depth pictures of a world that are not there yet."""

from __future__ import annotations

from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim_to_real.files import RunFolder
from sim_to_real.foreign import ForeignStage
from sim_to_real.foreign_mitsuba import MitsubaStage
from sim_to_real.objects import objects
from sim_to_real.settings import BenchmarkSettings
from sim_to_real.stage import Stage
from sim_to_real.views import SPLITS, View, round_of_views
from sim_to_real.workers import each_done
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.progress_bar import Progress


class _TakesViews(Protocol):
    config: StereoDepthSensorConfig

    def take_depth(self, views: list[View], seed: int) -> NDArray[np.float32]: ...


def take_pictures(
    folder: RunFolder,
    settings: BenchmarkSettings,
    world: str,
    split: str,
    rounds: int,
    device: str | int = "auto",
    workers: int = 1,
    progress: Progress | None = None,
) -> None:
    """Takes the missing depths of rounds 0 to rounds - 1. workers: processes that render with Mitsuba; our own renderer
    fills a device by itself."""
    missing = [number for number in range(rounds) if not folder.depth_path(world, split, number).exists()]
    if not missing:
        return
    if world == "foreign" and settings.foreign == "mitsuba":
        tasks = [(folder, settings, world, split, number) for number in missing]
        for done, _ in enumerate(each_done(_take_with_mitsuba, tasks, workers), 1):
            if progress is not None:
                progress(done / len(missing))
        return
    stage = (ForeignStage if world == "foreign" else Stage)(objects(), world, settings.camera, device)
    for done, number in enumerate(missing, 1):
        _take(folder, settings, world, split, number, stage)
        if progress is not None:
            progress(done / len(missing))


def _take(
    folder: RunFolder, settings: BenchmarkSettings, world: str, split: str, number: int, stage: _TakesViews
) -> None:
    views = round_of_views(objects(), settings.seed, split, number)
    depth = stage.take_depth(views, _seed(settings.seed, split, number))
    folder.write_depth(world, split, number, depth, stage.config.rgb_intrinsic)


def _take_with_mitsuba(folder: RunFolder, settings: BenchmarkSettings, world: str, split: str, number: int) -> None:
    _take(folder, settings, world, split, number, _mitsuba_stage(settings))


@cache
def _mitsuba_stage(settings: BenchmarkSettings) -> MitsubaStage:
    return MitsubaStage(objects(), settings.camera, settings.foreign_samples)


def _seed(seed: int, split: str, number: int) -> int:
    """The seed of a round's random numbers, different for each round."""
    return int(np.random.SeedSequence([seed, SPLITS.index(split), number]).generate_state(1)[0] % 2**31)
