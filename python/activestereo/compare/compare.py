# SPDX-License-Identifier: Apache-2.0
"""Compares the simulator with a capture: render its poses, fit the nuisances on the train frames, score both splits,
and look on the train frames where the model fails.

compare() computes; report/ writes compare.json, compare.png and report.html.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.capture.capture import EYES, SPLITS, Capture, read_capture
from activestereo.common.progress_bar import part_of
from activestereo.compare.depth_compare import DepthFrame, depth_scores, model_depths
from activestereo.compare.engine_prediction import predict_in_engines
from activestereo.compare.fit_model import fit_under_model
from activestereo.compare.mismatch import match_of, warnings_of
from activestereo.compare.noise import transfer_points
from activestereo.compare.noise_floors import floors_of
from activestereo.compare.render import WARP_SCALE, LayersOfFrames, render_halves
from activestereo.compare.render_noise import mean_of_halves, noise_square, rmse_without_noise
from activestereo.compare.unsteady_light import unsteady_light
from activestereo.compare.where_channels import where_it_fails
from activestereo.effects.core.model import Model
from activestereo.effects.core.view import View
from activestereo.effects.engines import SceneMeasurement

if TYPE_CHECKING:
    from activestereo.capture.capture import Frame
    from activestereo.compare.cache import LayerCache
    from activestereo.compare.nuisances import Fit
    from activestereo.compare.render import Renderer
    from activestereo.effects.engines.capture_renderer import CaptureRenderer


# Of the progress; what follows takes seconds.
_RENDER_SHARE = 0.9


@dataclass(frozen=True)
class Comparison:
    """scores: what compare.json holds (report/schema/compare.schema.json). predictions: {(frame id, eye): expected DN,
    float32 [height][width]}. depths: a DepthFrame for each frame with the device's depth. layers: {frame id: {eye:
    Layers}} as rendered, the mean of two halves of the samples. Errors of images are without the renderer's own noise
    (render_noise.py)."""

    capture: Capture
    scores: dict[str, Any]
    predictions: dict[tuple[int, str], np.ndarray]
    depths: list[DepthFrame]
    layers: LayersOfFrames
    model: Model


def compare(
    capture_path: str | Path, model: Model | None = None, renderer: Renderer | None = None, samples_per_pixel: int = 64,
    max_bounces: int = 8, seed: int = 0, cache: LayerCache | None = None,
    progress: Callable[[float], object] | None = None,
    engines: Callable[[Capture], CaptureRenderer] | None = None, survey: SceneMeasurement | None = None,
    calibrate: Callable[[Capture], Capture] | None = None,
) -> Comparison:  # fmt: skip
    """A Comparison of the capture folder. CaptureError where the capture cannot be used.

    model: effects on top of the base renderer, a Model; expected images are compared, so random effects show in the
    noise floor alone. renderer: see render.py; None for kuafu on the best device. progress: called as
    progress(fraction done). engines: makes a CaptureRenderer of the capture, in which
    the model's effects act; None: their image functions do. survey: an engines.SceneMeasurement, what is known of focal
    lengths and albedos. calibrate: replaces the capture's nominal rig and pattern by measured ones.
    """
    capture = read_capture(capture_path)
    if calibrate is not None:
        capture = calibrate(capture)
    measured = {(frame.id, eye): capture.ir(frame, eye) for frame in capture.frames for eye in EYES}
    if renderer is None:
        from activestereo.compare.kuafu_renderer import KuafuRenderer

        renderer = KuafuRenderer()
    share = part_of(progress, 0.0, _RENDER_SHARE)
    model = model or Model()
    halves = render_halves(capture, renderer, samples_per_pixel, max_bounces, seed, cache, share, WARP_SCALE)
    layers = mean_of_halves(halves)
    views = {
        key: View.of(capture, frame, key[1], layers[frame.id][key[1]], seed)
        for frame in capture.frames
        for key in _keys(frame)
    }
    if engines is None:
        fit, expected = predict_under_model(capture, model, (layers, *halves), views, measured)
    else:
        fit, expected = predict_in_engines(
            capture, model, survey or SceneMeasurement(), engines(capture), layers, views, measured
        )
    predictions = {key: (0.5 * (a + b)).astype(np.float32) for key, (a, b) in expected.items()}
    seen = {(f, e): (views[f, e].frame, layers[f][e], image) for (f, e), image in measured.items()}
    floors, law = floors_of(capture, views, measured, predictions, fit.nuisances.black_dn, unsteady_light(seen))
    match = match_of(capture, views, {key: layers[key[0]][key[1]].projector for key in views}, measured, law)
    depths = model_depths(capture, measured, predictions, views, law, model, seed)
    images = {key: _image_scores(measured[key], expected[key], floors.get(key)) for key in measured}
    scores = {
        "capture": capture.name,
        "renderer": renderer.version,
        "samples_per_pixel": samples_per_pixel,
        "max_bounces": max_bounces,
        "seed": seed,
        "warnings": warnings_of(fit.as_json(), match),
        "match": match.as_json(),
        "fit": fit.as_json(),
        "effects": [effect.id for effect, _ in model.effects],
        "noise_law": None if law is None else vars(law),
        "photon_transfer": transfer_points(capture),
        "ir": {split: _split_scores(capture.split(split), images) for split in SPLITS if capture.split(split)},
        "depth": depth_scores(depths),
        "frames": [_frame_scores(frame, images) for frame in capture.frames],
    }
    scores |= where_it_fails(capture, layers, views, measured, predictions, floors, law, depths, seed)
    return Comparison(capture, scores, predictions, depths, layers, model)


def predict_under_model(
    capture: Capture,
    model: Model,
    layers: Sequence[LayersOfFrames],
    views: Mapping[tuple[int, str], View],
    measured: Mapping[tuple[int, str], np.ndarray],
) -> tuple[Fit, dict[tuple[int, str], list[np.ndarray]]]:
    """(the Fit of the nuisances on the train frames, {(frame id, eye): expected DN, [height][width] each}) under a
    Model.

    layers: those that are fitted, then those whose images are wanted, or the first alone where they are the same;
    views and measured: {(frame id, eye): View and DN}. ValueError where there is nothing to fit.
    """
    lights = [{key: model.light(of[key[0]][key[1]], view) for key, view in views.items()} for of in layers]
    train = [(views[key], lights[0][key], measured[key]) for frame in capture.split("train") for key in _keys(frame)]
    fit = fit_under_model(model, train, capture.rig.max_dn)
    wanted = lights[1:] or lights
    return fit, {
        key: [model.signal(light[key], view, fit.nuisances) for light in wanted] for key, view in views.items()
    }


def _keys(frame: Frame) -> list[tuple[int, str]]:
    return [(frame.id, eye) for eye in EYES]


def _image_scores(measured: np.ndarray, halves: Sequence[np.ndarray], floor: Any) -> dict[str, Any]:
    """Sums of squares of one image, to be pooled over eyes and frames. halves: expected, of half the samples each."""
    residual = measured - 0.5 * (halves[0] + halves[1])
    return {
        "squares": float((residual**2).sum()),
        "noise_squares": noise_square(*halves) * residual.size,
        "sum": float(residual.sum()),
        "pixels": residual.size,
        "floor_variance": None if floor is None else floor[0],
        "floor_source": None if floor is None else floor[1],
    }


def _pool(images: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """RMSE without the renderer's noise, bias, that noise, the measurement's noise floor, and what is left above it of
    pooled pixels, DN."""
    pixels, squares, noise = (sum(image[name] for image in images) for name in ("pixels", "squares", "noise_squares"))
    rmse = rmse_without_noise(squares, pixels, noise)
    pooled = {
        "rmse_dn": rmse,
        "bias_dn": sum(image["sum"] for image in images) / pixels,
        "render_noise_dn": float(np.sqrt(noise / pixels)),
    }
    if any(image["floor_variance"] is None for image in images):
        return pooled | {"noise_floor_dn": None, "explainable_rmse_dn": None}
    floor = np.sqrt(sum(image["floor_variance"] * image["pixels"] for image in images) / pixels)
    explainable = np.sqrt(max(0.0, rmse**2 - floor**2))
    return pooled | {"noise_floor_dn": float(floor), "explainable_rmse_dn": float(explainable)}


def _split_scores(frames: Sequence[Frame], images: Mapping[tuple[int, str], dict[str, Any]]) -> dict[str, Any]:
    of = {eye: [images[frame.id, eye] for frame in frames] for eye in EYES}
    pooled = _pool([image for eye in EYES for image in of[eye]])
    sources = sorted({image["floor_source"] for eye in EYES for image in of[eye] if image["floor_source"]})
    return pooled | {
        "noise_floor_from": sources,
        "frames": [frame.id for frame in frames],
        "eyes": {eye: _pool(of[eye]) for eye in EYES},
    }


def _frame_scores(frame: Frame, images: Mapping[tuple[int, str], dict[str, Any]]) -> dict[str, Any]:
    eyes = {eye: _pool([images[frame.id, eye]]) for eye in EYES}
    pooled = _pool([images[frame.id, eye] for eye in EYES])
    source = images[frame.id, "left"]["floor_source"]
    return {"id": frame.id, "split": frame.split} | pooled | {"noise_floor_from": source, "eyes": eyes}
