# SPDX-License-Identifier: Apache-2.0
"""How matchers err on pairs whose truth is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import simsense
from matchers.pairs import MATERIALS, Pairs, PairStudio
from activestereo.camera.plan import matcher_parameters
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.sensor.foreign_matcher import Matcher, OpenCVMatcher
from activestereo.sensor.foreign_matcher import OnnxMatcher

EMITTERS = ("on", "off", "in turn")
_WRONG_PX = 1.0
_BLOCK, _LEAST_TEXTURE, _UNIQUENESS = 15, 10, 15


@dataclass(frozen=True)
class Score:
    """The score of a matcher on the pixels that both cameras see. measured: their share; wrong: the share of these that
    are off by more than a pixel; lost: the share of all that are unmeasured or so wrong; spread_px: root mean square
    error of the right ones."""

    measured: float
    wrong: float
    lost: float
    spread_px: float


def score(found: NDArray[np.float32], truth: NDArray[np.float32]) -> Score:
    """found: disparities, NaN = none; truth: NaN where it does not count."""
    counts = np.isfinite(truth)
    error = np.abs(found - truth)[counts]
    is_measured, is_right = np.isfinite(error), error <= _WRONG_PX
    if not len(error):
        return Score(*[float("nan")] * 4)
    of_measured = 1.0 - is_right.sum() / max(1, is_measured.sum())
    spread = float(np.sqrt(np.mean(error[is_right] ** 2))) if is_right.any() else float("nan")
    return Score(float(is_measured.mean()), float(of_measured), float(1.0 - is_right.mean()), spread)


class SimsenseMatcher:
    """simsense's engine on the processor, with these parameters of its matcher."""

    def __init__(self, config: StereoDepthSensorConfig, parameters: dict[str, Any]) -> None:
        width, height = config.ir_resolution
        camera, left_to_right = simsense.Camera(width, height, config.ir_intrinsic), np.eye(4)
        left_to_right[0, 3] = -config.focal_baseline_px_m / config.ir_intrinsic[0, 0]
        fitting: dict[str, Any] = parameters | {"max_disparity": config.max_disparity}
        self._engine = simsense.Engine(
            simsense.Device("host"), camera, camera, left_to_right, rectified=True, **fitting
        )

    def __call__(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> tuple[NDArray[np.float32], None]:
        found = [self._engine.compute(*pair, ("disparity",))["disparity"] for pair in zip(left, right, strict=True)]
        return np.array(found, np.float32), None


def _block_matcher(config: StereoDepthSensorConfig) -> Matcher:
    count = -(-config.max_disparity // 16) * 16
    matcher = cv2.StereoBM_create(count, _BLOCK)
    matcher.setTextureThreshold(_LEAST_TEXTURE)
    matcher.setUniquenessRatio(_UNIQUENESS)

    def match(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> tuple[NDArray[np.float32], None]:
        wide = (np.pad(images, ((0, 0), (0, 0), (count, 0)), "edge") for images in (left, right))
        return np.stack([matcher.compute(*pair)[:, count:] / 16.0 for pair in zip(*wide, strict=True)]), None

    return match


def matchers(
    config: StereoDepthSensorConfig, profiles: dict[str, dict[str, Any]], networks: list[Path]
) -> dict[str, Matcher]:
    """By name: simsense's profiles and the camera's own matcher, OpenCV's two, and networks in ONNX files."""
    out: dict[str, Matcher] = {f"simsense {name}": SimsenseMatcher(config, given) for name, given in profiles.items()}
    own = matcher_parameters(config)
    out[f"simsense {config.model}"] = SimsenseMatcher(config, own)
    out |= {"OpenCV SGBM": OpenCVMatcher(own), "OpenCV BM": _block_matcher(config)}
    return out | {path.stem: OnnxMatcher(path) for path in networks}


def scores(
    studio: PairStudio,
    matchers: dict[str, Matcher],
    rounds: int,
    seed: int,
    progress: Callable[[float], object] = lambda share: None,
) -> dict[str, dict[str, dict[str, Score]]]:
    """{matcher: {emitter: {material, or 'all': Score}}} of rounds of views. In turn: two pairs, one lit; a pixel is
    measured by the lit one, or else by the other."""
    taken: dict[str, list[Pairs]] = {"on": [], "off": []}
    for number in range(rounds):
        for emitter, pairs in studio.take(seed + number).items():
            taken[emitter].append(pairs)
        progress((number + 1) / (rounds + 1))
    truth = np.concatenate([pairs.truth for pairs in taken["on"]])
    material = np.concatenate([pairs.material for pairs in taken["on"]])
    out: dict[str, dict[str, dict[str, Score]]] = {}
    for name, matcher in matchers.items():
        found = {emitter: np.concatenate([_measured(matcher, one) for one in own]) for emitter, own in taken.items()}
        found["in turn"] = np.where(np.isfinite(found["on"]), found["on"], found["off"])
        out[name] = {emitter: _by_material(found[emitter], truth, material) for emitter in EMITTERS}
    progress(1.0)
    return out


def _measured(matcher: Matcher, pairs: Pairs) -> NDArray[np.float32]:
    disparity, _ = matcher(pairs.left, pairs.right)
    return np.where(disparity > 0, disparity, np.float32(np.nan))


def _by_material(
    found: NDArray[np.float32], truth: NDArray[np.float32], material: NDArray[np.uint8]
) -> dict[str, Score]:
    of_each = {
        name: score(found, np.where(material == place, truth, np.float32(np.nan)))
        for place, name in enumerate(MATERIALS)
    }
    return {"all": score(found, truth)} | of_each
