# SPDX-License-Identifier: Apache-2.0
"""Episodes of policies in the foreign world of Mitsuba, as a GIF."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from foreign_worlds import foreign_world
from PIL import Image

from stereo_grasp.world import STEPS

TILE_PX, EDGE_PX, GAP_PX = 80, 3, 6
COLORS = 16  # which keeps the file small
STEP_MS, LAST_MS = 300, 1500
HELD, LOST = (60, 180, 75), (200, 60, 50)
Act = Callable[[np.ndarray], np.ndarray]


def film(path: Path, policies: dict[str, Act], environments: int, seed: int, things: str) -> None:
    """A pair of rows for each policy, in their order: the left infrared image and the depth of each environment. A
    frame for each step; the last one has a green edge where the thing is held, a red one where it is not."""
    rows = [_course(act, environments, seed, things) for act in policies.values()]
    gap = np.full((GAP_PX, environments * TILE_PX, 3), 255, np.uint8)
    frames = []
    for step in range(len(rows[0])):
        parts = [part for row in rows for part in (row[step], gap)][:-1]
        frames.append(Image.fromarray(np.vstack(parts)).quantize(COLORS))
    path.parent.mkdir(parents=True, exist_ok=True)
    spans = [STEP_MS] * (len(frames) - 1) + [LAST_MS]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=spans, loop=0)


def _course(act: Act, environments: int, seed: int, things: str) -> list[np.ndarray]:
    world = foreign_world(environments, seed, things, "mitsuba")
    depth, frames, held = world.reset(seed=seed), [], np.zeros(environments, bool)
    for _ in range(STEPS):
        frames.append(_row(world.camera.infrared, depth))
        _, held = world.step(act(depth))
        depth = world.look()
    last = _row(world.camera.infrared, depth)
    for environment, holds in enumerate(held):
        x = environment * TILE_PX
        last[:TILE_PX, x : x + TILE_PX] = _edged(last[:TILE_PX, x : x + TILE_PX], HELD if holds else LOST)
    return [*frames, last]


def _row(infrared: np.ndarray, depth: np.ndarray) -> np.ndarray:
    near = 255 * np.clip((0.55 - depth) / 0.4, 0, 1) * (depth > 0)
    return np.vstack([np.hstack([_tile(one) for one in images]) for images in (infrared, near)])


def _tile(grey: np.ndarray) -> np.ndarray:
    image = Image.fromarray(grey.astype(np.uint8)).resize((TILE_PX, TILE_PX), Image.Resampling.BOX)
    return np.array(image.convert("RGB"))


def _edged(tile: np.ndarray, color: tuple[int, int, int]) -> np.ndarray:
    out = np.full_like(tile, color)
    inside = slice(EDGE_PX, -EDGE_PX)
    out[inside, inside] = tile[inside, inside]
    return out
