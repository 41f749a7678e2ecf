# SPDX-License-Identifier: Apache-2.0
"""Splits a device's depth error into parts: image effects, errors of any matcher, and the sensor's own.

Let d be the device's disparity, m our matcher's on the very same pair, and t the true geometry's. Let e and b be our
matcher's on pairs that a model expects with and without its effects, under the same noise. Then d - t is the sum of

    image effects   e - b
    any matcher     m - t - (e - b)
    filters         f(m) - m, f the effects found on disparity and depth
    calibration     an offset, and a share of t, by least squares of the remainder over all frames
    temperature     the same per kelvin, if frames differ in temperature
    other matcher   the rest

The last four are the sensor's own. A part's share is its covariance with the error over the error's mean square (Pratt
1987, Dividing the indivisible). Shares add up to 1, and noise of e and b that the device did not have counts nothing.
A part's RMS is the root of its share of the mean square, negative if it cancels others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Capture
from activestereo.compare.depth_compare import DepthFrame, DepthModel, model_depths
from activestereo.compare.image_errors import ImageErrors
from activestereo.diagnose.depth_engine import Depth
from activestereo.effects import Model, Stage, View

OWN = ("filters", "calibration", "temperature", "other matcher")
PARTS = ("image effects", "any matcher", *OWN)
# Errors farther from their median are mismatches, as in depth_engine.py.
_LARGEST_ERROR_PX = 1.0
_DISTANCES = 4
# A material with a smaller share of the pixels is not reported.
_LEAST_MATERIAL = 0.01
# {name: values [n] at the pixels where all are known}, in px of disparity unless the name states another unit. device:
# the device's error against the geometry. measured: our matcher's error on the same pair. by_effects: the change by the
# model's effects on images; by_filters: by those on disparity and depth. beside_model: the device's error less the
# model's. disparity: of the geometry. metres_per_px: depth error per disparity error. warming_k: the frame's
# temperature above the reference. distance_m, material: at the pixel.
Errors: TypeAlias = dict[str, NDArray[Any]]


def depth_split(
    capture: Capture, plain: ImageErrors, given: ImageErrors, found: ImageErrors, depth: Depth,
    name_of: Callable[[int], str], seed: int,
) -> dict[str, Any] | None:  # fmt: skip
    """Returns diagnose.json's `depth_split`; None if no pixel has a depth from both engines.

    capture: with its stated geometry, which the device's matcher assumes. plain, given, found: image errors of the base
    model, the given model and model.json at the estimated geometry. depth: the judgement of the depth engine. name_of:
    returns a material's name for its index.
    """
    given_filters, filters = (m.only(lambda e, _: e.stage > Stage.DIGITAL) for m in (given.model, found.model))
    for f in (*depth.named(is_choice=True), *depth.named(is_choice=False)[:1]):
        filters = filters.with_effect(f.effect, **{n: v.value for n, v in f.parameters().items()})

    def depths(errors: ImageErrors) -> dict[int, DepthFrame]:
        """Matches the image pairs that a model predicts, under the found model's noise; returns {frame id: depths}."""
        under = replace(errors, views=found.views, noise_model=found.noise_model)
        return {d.frame.id: d for d in model_depths(capture, under, Model(), seed)}

    base, expected = depths(plain), []
    for errors, on_depth in ((given, given_filters), (found, filters)):
        expected.append((base if errors is plain else depths(errors), on_depth))
    engine = DepthModel(capture) if base else None
    both: list[list[Errors]] = [[], []]
    for key, bare in base.items():
        assert engine is not None
        own, view = engine.depth(*(capture.ir(bare.frame, side) for side in SIDES)), found.views[key, "left"]
        matched = [_matched(own, bare, frames[key], on_depth, view) for frames, on_depth in expected]
        here = matched[0][1] & matched[1][1]
        for out, (images, _) in zip(both, matched, strict=True):
            out.append({name: image[here] for name, image in images.items()})
    before, after = both
    if not any(frame["device"].size for frame in after):
        return None
    named = {"images_agree": depth.images_agree, "filters": [effect.id for effect, _ in filters.effects]}
    return named | split_of(before, after, name_of)


def split_of(before: Sequence[Errors], after: Sequence[Errors], name_of: Callable[[int], str]) -> dict[str, Any]:
    """Returns the parts of the depth error under two models at the same pixels, in all, by distance and by material."""
    joined = [{name: np.concatenate([f[name] for f in frames]) for name in frames[0]} for frames in (before, after)]
    parts = [_parts(errors) for errors in joined]
    distance_m, material = (joined[1][name] for name in ("distance_m", "material"))

    def told(here: NDArray[np.bool_]) -> dict[str, Any]:
        own = (_told(errors, px, here) for errors, px in zip(joined, parts, strict=True))
        return {"pixels": int(here.sum())} | dict(zip(("before", "after"), own, strict=True))

    edges = np.quantile(distance_m, np.linspace(0.0, 1.0, _DISTANCES + 1))
    numbers, counts = np.unique(material, return_counts=True)
    large = [k for n, k in sorted(zip(-counts, numbers, strict=True)) if -n >= _LEAST_MATERIAL * material.size]
    return told(np.ones(distance_m.shape, dtype=bool)) | {
        "by_distance": [
            {"from_m": float(low), "to_m": float(high)} | told((distance_m >= low) & (distance_m <= high))
            for low, high in pairwise(edges)
        ],
        "by_material": [{"material": name_of(int(k))} | told(material == k) for k in large],
    }


def _matched(
    own: NDArray[np.float32], base: DepthFrame, expected: DepthFrame, on_depth: Model, view: View
) -> tuple[Errors, NDArray[np.bool_]]:
    """Returns a frame's Errors as images [height][width], and a mask of the pixels where all are known. own: our
    matcher's depth of the measured pair. base, expected: depths of the pairs that the base model and a model predict.
    on_depth: that model's effects on disparity and depth."""
    filtered, modelled = (on_depth.depth(z, view) for z in (own, expected.model[0]))
    depths = base.measured, own, filtered, modelled, *base.model, *expected.model
    matched = [base.disparity_error(depth, base.truth) for depth in depths]
    device, measured, by_filters, by_model, *drawn = (error for error, _ in matched)
    known = np.logical_and.reduce([valid for _, valid in matched])
    for error in (device - measured, measured, *drawn):
        if known.any():
            known &= np.abs(error - np.median(error[known])) < _LARGEST_ERROR_PX
    with np.errstate(divide="ignore"):
        disparity = base.focal_baseline / base.truth
    images = {
        "device": device,
        "measured": measured,
        "by_effects": np.mean(drawn[2:], axis=0) - np.mean(drawn[:2], axis=0),
        "by_filters": by_filters - measured,
        "beside_model": device - by_model,
        "disparity": disparity,
        "distance_m": base.truth,
        "metres_per_px": -base.truth * base.measured / base.focal_baseline,
        "material": np.zeros(base.truth.shape, dtype=int) if view.material is None else view.material,
        "warming_k": np.full(base.truth.shape, view.warming_k),
    }
    return images, known


def _parts(errors: Errors) -> dict[str, NDArray[np.float64]]:
    """Returns {part: its errors, px [n]}."""
    rest = errors["device"] - errors["measured"] - errors["by_filters"]
    warming = errors["warming_k"] - errors["warming_k"].mean()
    line = np.stack([np.ones_like(rest), errors["disparity"]], axis=1)
    columns = np.hstack([line, line * warming[:, None]]) if np.ptp(warming) > 0 else line
    fitted = columns * np.linalg.lstsq(columns, rest, rcond=None)[0]
    effects = errors["by_effects"]
    of_images = [effects, errors["measured"] - effects, errors["by_filters"]]
    of_line = [fitted[:, :2].sum(axis=1), fitted[:, 2:].sum(axis=1), rest - fitted.sum(axis=1)]
    return dict(zip(PARTS, [*of_images, *of_line], strict=True))


def _told(errors: Errors, px: Mapping[str, NDArray[np.float64]], here: NDArray[np.bool_]) -> dict[str, Any]:
    """Returns the RMS error, the RMS error that the model leaves, and each part's share, in px of disparity and in
    metres. px: the result of _parts(). here: mask of the pixels that count."""
    out: dict[str, Any] = {"rms_px": 0.0, "rms_m": 0.0, "beside_model_px": 0.0, "beside_model_m": 0.0}
    parts: dict[str, dict[str, float]] = {name: {} for name in (*PARTS, "sensor's own")}
    for unit, factor in (("px", np.ones(here.sum())), ("m", errors["metres_per_px"][here])):
        own = {name: values[here] * factor for name, values in px.items()}
        error = np.sum(np.stack(list(own.values())), axis=0)
        square = float(np.mean(error**2))
        shares = {name: float(np.mean(values * error)) / max(square, 1e-30) for name, values in own.items()}
        shares["sensor's own"] = sum(shares[name] for name in OWN)
        out[f"rms_{unit}"] = float(np.sqrt(square))
        out[f"beside_model_{unit}"] = float(np.sqrt(np.mean((errors["beside_model"][here] * factor) ** 2)))
        for name, share in shares.items():
            rms = float(np.sign(share) * np.sqrt(abs(share) * square))
            parts[name] |= {f"share_{unit}": share, f"rms_{unit}": rms}
    return out | {"parts": parts}
