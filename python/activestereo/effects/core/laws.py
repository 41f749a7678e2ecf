# SPDX-License-Identifier: Apache-2.0
"""Checks the laws that every effect obeys on a small synthetic view. `effect check` and the tests run it.

1 at neutral parameters the effect changes nothing; 2 the same seed gives the same bits, and random effects vary with
seed and frame as they declare; 3 every value in range gives finite numbers; 4 every parameter has an influence; 5 the
input is left unchanged.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.effects.core.descriptor import Effect, Randomness, Stage
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View

_SIZE = (72, 96)


def broken_laws(effect: Effect) -> list[str]:
    """Returns one sentence per law that the effect breaks; empty for a lawful effect."""
    for side in ("right", "left"):  # an effect may be one camera's
        view = example_view(side)
        value = example_value(effect.stage, view)
        try:
            given = effect(deepcopy(value), view, **effect.typical_values)
        except Exception as error:  # a user's function may raise anything
            last = traceback.extract_tb(error.__traceback__)[-1]
            said = f"fails at {Path(last.filename).name}, line {last.lineno}: {type(error).__name__}: {error}"
            return [f"{effect.id}: {said}"]
        if _kind(given) != _kind(value):
            return [f"{effect.id}: returns {_kind(given)}, not {_kind(value)}"]
        if not _same(given, value):
            break
    return [f"{effect.id}: {said}" for said in _broken(effect, value, view)]


def _kind(value: Any) -> str:
    return f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else f"a {type(value).__name__}"


def example_view(side: str = "right") -> View:
    """Returns a synthetic View: a slanted plane before a wall, seen by a warm, moving rig with a dot pattern."""
    height, width = _SIZE
    v, u = np.mgrid[0:height, 0:width].astype(np.float64)
    slanted = (u > 30) & (u < 66) & (v > 20) & (v < 56)
    depth = np.where(slanted, 0.6 + 0.002 * u + 0.001 * v, 1.1)
    normal = np.where(
        slanted[..., None], np.array([0.2, 0.1, -1.0]) / np.linalg.norm([0.2, 0.1, 1.0]), [0.0, 0.0, -1.0]
    )
    pose, left_to_right, left_to_projector = np.eye(4), np.eye(4), np.eye(4)
    left_to_right[0, 3], left_to_projector[0, 3] = -0.05, -0.015
    left_to_camera = left_to_right if side == "right" else np.eye(4)
    frame = Frame(
        id=0, left_path=None, right_path=None, timestamp_s=2.003, exposure_s=0.004, camera_to_world=pose,
        split="train", gain=2.0, temperature_c=45.0, camera_velocity=np.array([0.5, 0.1, 0.2, 0.1, 0.6, 0.3]),
    )  # fmt: skip
    at_v, at_u = np.mgrid[0:140, 0:200]
    dots = 0.03 + 0.9 * np.exp(-(((at_u % 9) - 4) ** 2 + ((at_v % 7) - 3) ** 2) / 2.5)
    return View(
        side=side,
        K=np.array([[60.0, 0, (width - 1) / 2], [0, 60.0, (height - 1) / 2], [0, 0, 1]]),
        depth_m=depth,
        normal=normal,
        pattern=dots.astype(np.float32),
        projector_K=np.array([[110.0, 0, 99.5], [0, 110.0, 69.5], [0, 0, 1]]),
        camera_to_projector=left_to_projector @ np.linalg.inv(left_to_camera),
        left_to_camera=left_to_camera,
        frame=frame,
        material=slanted.astype(np.uint32),
        before=1.02 * 60.0 * 0.05 / depth * ((u + 3 * v) % 19 > 0),
    )


def example_value(stage: Stage, view: View) -> Light | np.ndarray:
    """Returns an input for an effect of the stage: a Light, radiance, DN (some above full scale), disparity or
    depth."""
    height, width = view.shape
    v, u = np.mgrid[0:height, 0:width].astype(np.float64)
    flat = 0.2 / view.depth_m**2
    direct = flat * (0.1 + 0.8 * ((u // 3 + v // 3) % 2))
    light = Light(direct, 0.05 * flat, 0.3 + 0.001 * u + 0.002 * v, flat)
    if stage < Stage.OPTICS:
        return light
    if stage is Stage.DEPTH:
        return view.depth_m * ((u + 2 * v) % 17 > 0)
    if stage is Stage.DISPARITY:
        return view.K[0, 0] * view.baseline_m / view.depth_m * ((u + 2 * v) % 17 > 0)
    if stage is Stage.OPTICS:
        return np.stack([light.direct, light.ambient])
    return 20.0 + 300.0 * light.direct + v


def _arrays(value: Any) -> np.ndarray:
    return value.images if isinstance(value, Light) else value


def _same(a: Any, b: Any, tolerance: float = 0.0) -> bool:
    a, b = _arrays(a), _arrays(b)
    return a.shape == b.shape and np.allclose(a, b, rtol=tolerance, atol=tolerance * max(1.0, np.abs(a).max()))


def _broken(effect: Effect, value: Any, view: View) -> Iterator[str]:
    """Yields a sentence for each broken law."""
    base, given = effect.typical_values, deepcopy(value)
    if not _same(effect(value, view, **effect.neutral_values), value, 1e-6):
        yield "neutral parameters change the image"
    first = effect(given, view, **base)
    if not _same(first, effect(value, view, **base)):
        yield "the same input gives another output (draw from view.rng alone)"
    says = f"says randomness {effect.randomness.value}, but"
    varies_with_seed = not _same(first, effect(value, replace(view, seed=1), **base))
    if varies_with_seed != (effect.randomness is not Randomness.NONE):
        yield f"{says} the seed {'matters' if varies_with_seed else 'does not matter'}"
    next_view = replace(view, frame=replace(view.frame, id=view.frame.id + 1))
    varies_with_frame = not _same(first, effect(value, next_view, **base))
    if varies_with_frame != (effect.randomness is Randomness.TEMPORAL):
        yield f"{says} repeats {'differ' if varies_with_frame else 'are equal'}"
    ends = [sorted({p.low, p.high, p.typical_value}) for p in effect.parameters]
    for combination in product(*ends[:6]):
        values = dict(zip((p.name for p in effect.parameters), combination, strict=False))
        if not np.isfinite(_arrays(effect(value, view, **values))).all():
            yield f"gives values that are not finite at {values}"
            break
    for p in effect.parameters:
        outputs = [effect(value, view, **(base | {p.name: end})) for end in (p.low, p.typical_value, p.high)]
        if all(_same(outputs[0], other, 1e-9) for other in outputs[1:]):
            yield f"parameter {p.name} has no influence"
    if not _same(given, value):
        yield "changes its input in place"
