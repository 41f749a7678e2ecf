# SPDX-License-Identifier: Apache-2.0
"""Turns a comparison's images and depths into the channels that where.py and tree.py analyse."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.capture.capture import SIDES, Capture, ImageKey
from activestereo.compare.tree import HonestTree
from activestereo.compare.where import (
    LARGEST_DISPARITY_ERROR_PX,
    ResidualImage,
    covariate_maps,
    gather_samples,
    where_tables,
)
from activestereo.effects.core.scene_surfaces import surface_names

if TYPE_CHECKING:
    from activestereo.capture.capture import Frame
    from activestereo.compare.depth_compare import DepthFrame
    from activestereo.compare.noise import NoiseModel
    from activestereo.compare.render import LayersOfFrames
    from activestereo.compare.where import Samples
    from activestereo.effects import View

# An excess below this share of the floor's variance may be the renderer's Monte Carlo noise and is not analysed.
_SMALLEST_EXCESS = 0.05


def where_it_fails(
    capture: Capture, layers: LayersOfFrames, views: Mapping[ImageKey, View], measured: Mapping[ImageKey, np.ndarray],
    predictions: Mapping[ImageKey, np.ndarray], noise_variances: Mapping[ImageKey, tuple[float, str]],
    noise_model: NoiseModel | None, depths: Sequence[DepthFrame], seed: int = 0,
) -> dict[str, Any]:  # fmt: skip
    """Computes compare.json's {where: tables, regions: {channel: ...}} from the train frames."""
    maps, infrared = {}, []
    for frame in capture.split("train"):
        for side in SIDES:
            key, expected = (frame.id, side), predictions[frame.id, side]
            maps[key] = covariate_maps(views[key], layers[frame.id][side].material, expected, capture.rig.baseline_m)
            # Each pixel's variance by the noise model, scaled to the image's own floor; 0 if that is unknown.
            floor = np.zeros(expected.shape)
            if key in noise_variances and noise_model is not None:
                variance, own = noise_model.variance(expected, frame.gain), noise_variances[key][0]
                mean = variance.mean()
                floor = variance * (own / mean) if mean > 0 else np.full(expected.shape, own)
            infrared.append((key, measured[key] - expected, floor, views[key].known, _pose(frame, side)))
    channels = residual_channels(infrared, [d for d in depths if d.frame.split == "train"], maps, seed)
    name_of = surface_text(capture.scene_path)
    return {
        "where": where_tables(channels, name_of, seed),
        "regions": {
            name: {
                "is_explainable": explainable,
                "rmse": float(np.sqrt(np.mean(samples.residual**2))),
                "noise_floor": float(np.sqrt(samples.floor.mean())),
            }
            | (HonestTree(samples, seed).regions(name_of) if explainable else {"leaves": [], "headline": None})
            for name, (samples, _, explainable) in channels.items()
        },
    }


def residual_channels(
    infrared: Sequence[tuple[ImageKey, np.ndarray, np.ndarray, np.ndarray | None, bytes]], depths: Sequence[DepthFrame],
    maps: Mapping[ImageKey, dict[str, np.ndarray]], seed: int = 0,
) -> dict[str, tuple[Samples, str, bool]]:  # fmt: skip
    """Collects the samples of each channel (infrared, disparity, validity); returns {channel: (Samples, unit, whether
    there is error to explain)}. infrared: [(key, residual, floor, mask of the known scene or None, pose)]. maps:
    {(frame id, side): {covariate: [height][width]}}."""
    images = {
        "infrared": [
            ResidualImage(r, floor, np.ones(r.shape, bool) if known is None else known, maps[key], pose)
            for key, r, floor, known, pose in infrared
        ]
    }
    images["disparity"], images["validity"] = [], []
    for d in depths:
        here, pose = maps[d.frame.id, "left"], _pose(d.frame, "left")
        # Device minus model, and the squared difference of two exposures of the model.
        error, valid = d.disparity_error(d.measured, d.model[0])
        repeat, again = d.disparity_error(d.model[0], d.model[1])
        limit = LARGEST_DISPARITY_ERROR_PX
        error, floor = np.clip(error, -limit, limit), np.clip(repeat, -limit, limit) ** 2
        images["disparity"].append(ResidualImage(error, floor, valid & again, here, pose))
        device, one, two = (np.asarray(z > 0, dtype=np.float64) for z in (d.measured, *d.model))
        images["validity"].append(ResidualImage(device - one, np.abs(one - two), np.ones(one.shape, bool), here, pose))
    units = {"infrared": "DN", "disparity": "px", "validity": "1"}
    channels = {}
    for name, parts in images.items():
        samples = gather_samples(parts, seed) if parts else None
        if samples is not None:
            channels[name] = (samples, units[name], bool(samples.excess.sum() > _SMALLEST_EXCESS * samples.floor.sum()))
    return channels


def surface_text(scene_path: Path) -> Callable[[int], str]:
    """Returns a function that names a surface by its material number."""
    names = surface_names(scene_path)
    return lambda index: names[index] if index < len(names) else f"material {index}"


def _pose(frame: Frame, side: str) -> bytes:
    """Returns bytes that are equal for images from the same camera and pose, whose static errors are the same."""
    return side.encode() + np.ascontiguousarray(frame.camera_to_world, dtype=np.float64).tobytes()
