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
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

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
Image = NDArray[np.float64]
Depths = Mapping[int, DepthFrame]


@dataclass(frozen=True)
class DepthErrors:
    """One frame's errors of disparity at the pixels where all are known, px [n].

    device: the device's error against the geometry. measured: our matcher's error on the same pair. by_effects: the
    change by the model's effects on images. by_filters: the change by its effects on disparity and depth. beside_model:
    the device's error less the model's. disparity: of the geometry, px. metres_per_px: depth error per disparity error.
    warming_k: the frame's temperature above the reference.
    """

    device: Image
    measured: Image
    by_effects: Image
    by_filters: Image
    beside_model: Image
    disparity: Image
    distance_m: Image
    metres_per_px: Image
    material: NDArray[np.integer[Any]]
    warming_k: float


def depth_split(
    capture: Capture, plain: ImageErrors, given: ImageErrors, found: ImageErrors, depth: Depth,
    name_of: Callable[[int], str], seed: int,
) -> dict[str, Any] | None:  # fmt: skip
    """Returns diagnose.json's `depth_split`; None if no pixel has a depth of both engines.

    capture: as stated, which the device's matcher assumes. plain, given, found: image errors of the base model, the
    given model and model.json, at the corrected geometry. depth: the judgement of the depth engine. name_of: returns a
    material's name by its number.
    """
    filters = _on_depth(found.model)
    for f in (*depth.choices(), *depth.faults()[:1]):
        filters = filters.with_effect(f.effect, **{n: v.value for n, v in f.parameters.items()})
    base, own = _depths(capture, plain, found, seed), _own_depths(capture)
    models = (given, _on_depth(given.model)), (found, filters)
    expected = [(base if e is plain else _depths(capture, e, found, seed), on_depth) for e, on_depth in models]
    before, after = [], []
    for key, bare in base.items():
        view = found.views[key, "left"]
        both = [_Matched.of(own[key], bare, depths[key], on_depth, view) for depths, on_depth in expected]
        here = both[0].known & both[1].known
        before.append(both[0].errors(here))
        after.append(both[1].errors(here))
    if not any(frame.device.size for frame in after):
        return None
    named = {"images_agree": depth.images_agree, "filters": [effect.id for effect, _ in filters.effects]}
    return named | split_of(before, after, name_of)


def split_of(
    before: Sequence[DepthErrors], after: Sequence[DepthErrors], name_of: Callable[[int], str]
) -> dict[str, Any]:
    """Returns the parts of the error under two models of the same pixels: in all, by distance and by material."""
    parts = {"before": _Parts.of(before), "after": _Parts.of(after)}
    distance_m, material = parts["after"].distance_m, parts["after"].material

    def told(here: NDArray[np.bool_]) -> dict[str, Any]:
        return {"pixels": int(here.sum())} | {name: own.as_json(here) for name, own in parts.items()}

    edges = np.quantile(distance_m, np.linspace(0.0, 1.0, _DISTANCES + 1))
    far = [(distance_m >= low) & (distance_m <= high) for low, high in pairwise(edges)]
    numbers, counts = np.unique(material, return_counts=True)
    large = [k for n, k in sorted(zip(-counts, numbers, strict=True)) if -n >= _LEAST_MATERIAL * material.size]
    return told(np.ones(distance_m.shape, dtype=bool)) | {
        "by_distance": [
            {"from_m": float(low), "to_m": float(high)} | told(here)
            for (low, high), here in zip(pairwise(edges), far, strict=True)
        ],
        "by_material": [{"material": name_of(int(k))} | told(material == k) for k in large],
    }


@dataclass(frozen=True)
class _Matched:
    """A frame's errors of disparity under a model, px [height][width], by the names of DepthErrors' fields. known: the
    pixels where all are known."""

    images: dict[str, Image]
    known: NDArray[np.bool_]
    frame: DepthFrame
    view: View

    @classmethod
    def of(
        cls, own: NDArray[np.float32], base: DepthFrame, expected: DepthFrame, on_depth: Model, view: View
    ) -> _Matched:
        """Computes the errors. own: our matcher's depth of the measured pair, m. base, expected: depths of the base
        model's and of the model's pairs. on_depth: the model's effects on disparity and depth."""
        filtered, modelled = (on_depth.depth(z, view) for z in (own, expected.model[0]))
        depths = base.measured, own, filtered, modelled, *base.model, *expected.model
        matched = [base.disparity_error(depth, base.truth) for depth in depths]
        device, measured, by_filters, by_model, *drawn = (error for error, _ in matched)
        known = np.logical_and.reduce([valid for _, valid in matched])
        for error in (device - measured, measured, *drawn):
            if known.any():
                known &= np.abs(error - np.median(error[known])) < _LARGEST_ERROR_PX
        images = {
            "device": device,
            "measured": measured,
            "by_effects": np.mean(drawn[2:], axis=0) - np.mean(drawn[:2], axis=0),
            "by_filters": by_filters - measured,
            "beside_model": device - by_model,
        }
        return cls(images, known, base, view)

    def errors(self, here: NDArray[np.bool_]) -> DepthErrors:
        """Returns the errors at the pixels `here`."""
        truth, device = self.frame.truth[here], self.frame.measured[here]
        return DepthErrors(
            **{name: image[here] for name, image in self.images.items()},
            disparity=self.frame.focal_baseline / truth,
            distance_m=truth,
            metres_per_px=-truth * device / self.frame.focal_baseline,
            material=np.zeros(truth.shape, dtype=int) if self.view.material is None else self.view.material[here],
            warming_k=self.view.warming_k,
        )


@dataclass(frozen=True)
class _Parts:
    """The errors of all frames' pixels. px: {part: its errors [n]}."""

    px: dict[str, Image]
    beside_model: Image
    metres_per_px: Image
    distance_m: Image
    material: NDArray[np.integer[Any]]

    @classmethod
    def of(cls, frames: Sequence[DepthErrors]) -> _Parts:
        joined = {
            name: np.concatenate([getattr(f, name) for f in frames])
            for name in DepthErrors.__dataclass_fields__
            if name != "warming_k"
        }
        rest = joined["device"] - joined["measured"] - joined["by_filters"]
        warming = np.concatenate([np.full(f.device.shape, f.warming_k) for f in frames])
        warming = warming - warming.mean()
        line = np.stack([np.ones_like(rest), joined["disparity"]], axis=1)
        columns = np.hstack([line, line * warming[:, None]]) if np.ptp(warming) > 0 else line
        fitted = columns * np.linalg.lstsq(columns, rest, rcond=None)[0]
        effects = joined["by_effects"]
        of_images = [effects, joined["measured"] - effects, joined["by_filters"]]
        of_line = [fitted[:, :2].sum(axis=1), fitted[:, 2:].sum(axis=1), rest - fitted.sum(axis=1)]
        kept = (joined[name] for name in ("beside_model", "metres_per_px", "distance_m", "material"))
        return cls(dict(zip(PARTS, [*of_images, *of_line], strict=True)), *kept)

    def as_json(self, here: NDArray[np.bool_]) -> dict[str, Any]:
        """Returns the RMS of the error, the RMS that the model leaves of it, and each part's share, in pixels and
        metres. here: the pixels that count."""
        out: dict[str, Any] = {"rms_px": 0.0, "rms_m": 0.0, "beside_model_px": 0.0, "beside_model_m": 0.0}
        parts: dict[str, dict[str, float]] = {name: {} for name in (*PARTS, "sensor's own")}
        for unit, factor in (("px", np.ones(here.sum())), ("m", self.metres_per_px[here])):
            own = {name: values[here] * factor for name, values in self.px.items()}
            error = np.sum(np.stack(list(own.values())), axis=0)
            square = float(np.mean(error**2))
            shares = {name: float(np.mean(values * error)) / max(square, 1e-30) for name, values in own.items()}
            shares["sensor's own"] = sum(shares[name] for name in OWN)
            out |= {f"rms_{unit}": float(np.sqrt(square))}
            out |= {f"beside_model_{unit}": float(np.sqrt(np.mean((self.beside_model[here] * factor) ** 2)))}
            for name, share in shares.items():
                rms = float(np.sign(share) * np.sqrt(abs(share) * square))
                parts[name] |= {f"share_{unit}": share, f"rms_{unit}": rms}
        return out | {"parts": parts}


def _on_depth(model: Model) -> Model:
    return Model(tuple((e, p) for e, p in model.effects if e.stage > Stage.DIGITAL))


def _own_depths(capture: Capture) -> dict[int, NDArray[np.float32]]:
    """Returns {frame id: our matcher's depth of the measured pair, m [height][width]} for frames with the device's
    depth."""
    frames = [frame for frame in capture.frames if frame.depth_path is not None]
    engine = DepthModel(capture) if frames else None
    return {f.id: engine.depth(*(capture.ir(f, side) for side in SIDES)) for f in frames if engine is not None}


def _depths(capture: Capture, errors: ImageErrors, found: ImageErrors, seed: int) -> Depths:
    """Returns {frame id: our matcher's depths of the pairs that a model expects}, under the found model's noise."""
    frames = model_depths(capture, errors.measured, errors.predictions, found.views, found.noise_model, Model(), seed)
    return {d.frame.id: d for d in frames}
