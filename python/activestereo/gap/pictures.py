# SPDX-License-Identifier: Apache-2.0
"""Takes the depth pictures of a world that are not there yet."""

from __future__ import annotations

import numpy as np

from activestereo.gap.files import RunFolder
from activestereo.gap.foreign import ForeignStage
from activestereo.gap.objects import objects
from activestereo.gap.settings import GapSettings
from activestereo.gap.stage import Stage
from activestereo.gap.views import SPLITS, round_of_views
from activestereo.gap.worlds import World
from activestereo.progress_bar import Progress


def take_pictures(
    folder: RunFolder,
    settings: GapSettings,
    world: World,
    split: str,
    rounds: int,
    device: str | int = "auto",
    progress: Progress | None = None,
) -> None:
    """The depths that are missing of rounds 0 to rounds - 1."""
    missing = [number for number in range(rounds) if not folder.depth_path(world.name, split, number).exists()]
    if not missing:
        return
    things = objects()
    if world.mode == "foreign":
        stage: Stage = ForeignStage(things, world, settings.camera, device, settings.foreign_samples)
    else:
        stage = Stage(things, world, settings.camera, device)
    for done, number in enumerate(missing, 1):
        views = round_of_views(things, settings.seed, split, number)
        depth = stage.take(views, _seed(settings.seed, split, number))
        folder.write_depth(world.name, split, number, depth, stage.config.rgb_intrinsic)
        if progress is not None:
            progress(done / len(missing))


def _seed(seed: int, split: str, number: int) -> int:
    """Of what a round's pictures draw, another one for each round."""
    return int(np.random.SeedSequence([seed, SPLITS.index(split), number]).generate_state(1)[0] % 2**31)
