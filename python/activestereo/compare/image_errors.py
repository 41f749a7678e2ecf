# SPDX-License-Identifier: Apache-2.0
"""The errors of a model's expected infrared images: the only figures that `compare` and `diagnose` tell of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, SPLITS, Capture, Frame, ImageKey
from activestereo.compare.engine_prediction import changes_no_ray, engine_lights, reflected_lights
from activestereo.compare.noise import NoiseModel, noise_variances_of
from activestereo.compare.nuisances import Fit, predict_under_model
from activestereo.compare.render import Halves, LayersOfFrames
from activestereo.compare.render_noise import mean_of_halves, noise_square, rmse_without_noise
from activestereo.compare.unsteady_light import unsteady_light
from activestereo.effects.core.model import Model
from activestereo.effects.core.view import View
from activestereo.effects.engines import SceneMeasurement

if TYPE_CHECKING:
    from activestereo.compare.cache import LayerCache
    from activestereo.effects.engines.capture_renderer import CaptureRenderer


@dataclass(frozen=True)
class ImageErrors:
    """A model's expected images beside the measured ones, {(frame id, side): [height][width]}, DN.

    layers: the base model's light, {frame id: {side: Layers}}, the mean of two halves of the samples. fit: the
    nuisances under the model, fitted to the train frames. noise_variances: {(frame id, side): (variance in DN^2, where
    it is from)}; noise_model: the noise model or None."""

    capture: Capture
    model: Model
    layers: LayersOfFrames
    views: dict[ImageKey, View]
    measured: dict[ImageKey, NDArray]
    fit: Fit
    predictions: dict[ImageKey, NDArray[np.float32]]
    noise_variances: dict[ImageKey, tuple[float, str]]
    noise_model: NoiseModel | None
    _sums: dict[ImageKey, dict[str, Any]]

    def residuals(self) -> dict[ImageKey, NDArray[np.float32]]:
        """{(frame id, side): measured minus expected DN [height][width]}."""
        return residuals_of(self.measured, self.predictions)

    def by_split(self) -> dict[str, dict[str, Any]]:
        """{"train" or "test": errors pooled over its images, and of each camera}; a split without frames is left
        out."""
        return {split: self._of_split(frames) for split in SPLITS if (frames := self.capture.split(split))}

    def by_frame(self) -> list[dict[str, Any]]:
        """Errors of every frame, and of each camera."""
        return [self._of_frame(frame) for frame in self.capture.frames]

    def _of_split(self, frames: Sequence[Frame]) -> dict[str, Any]:
        of = {side: [self._sums[frame.id, side] for frame in frames] for side in SIDES}
        pooled = _pool([image for side in SIDES for image in of[side]])
        sources = sorted({image["floor_source"] for side in SIDES for image in of[side] if image["floor_source"]})
        return pooled | {
            "noise_floor_from": sources,
            "frames": [frame.id for frame in frames],
            "cameras": {side: _pool(of[side]) for side in SIDES},
        }

    def _of_frame(self, frame: Frame) -> dict[str, Any]:
        sides = {side: _pool([self._sums[frame.id, side]]) for side in SIDES}
        pooled = _pool([self._sums[frame.id, side] for side in SIDES])
        source = self._sums[frame.id, "left"]["floor_source"]
        return {"id": frame.id, "split": frame.split} | pooled | {"noise_floor_from": source, "cameras": sides}


def residuals_of(
    measured: Mapping[ImageKey, NDArray], predictions: Mapping[ImageKey, NDArray[np.float32]]
) -> dict[ImageKey, NDArray[np.float32]]:
    """{(frame id, side): measured minus expected DN}."""
    return {key: measured[key].astype(np.float32) - expected for key, expected in predictions.items()}


def image_errors(
    capture: Capture,
    model: Model,
    halves: Halves,
    seed: int = 0,
    engines: Callable[[Capture], CaptureRenderer] | None = None,
    scene_measurement: SceneMeasurement | None = None,
    progress: Callable[[float], object] | None = None,
    cache: LayerCache | None = None,
    mean: LayersOfFrames | None = None,
) -> ImageErrors:
    """The ImageErrors of a model with the nuisances that fit the train frames. ValueError: there is nothing to fit.

    halves: the base model's light on all frames, by render_halves(). engines: makes a CaptureRenderer of the capture,
    in which the model's effects act; None: their image functions do. scene_measurement: what is known of focal lengths
    and albedos, which engines alone show. progress: called as progress(fraction done) while engines render.
    cache: where the engines' light is kept, None for the user's own. mean: mean_of_halves(halves), where it is known.
    """
    layers = mean_of_halves(halves) if mean is None else mean
    measured = {(frame.id, side): capture.ir(frame, side) for frame in capture.frames for side in SIDES}
    views = {
        (frame.id, side): View.of(capture, frame, side, layers[frame.id][side], seed)
        for frame in capture.frames
        for side in SIDES
    }
    counted = {key: _where_known(view, measured[key]) for key, view in views.items()}
    known = scene_measurement or SceneMeasurement()
    if engines is None:
        lights = [{(f, e): model.light(of[f][e], view) for (f, e), view in views.items()} for of in (layers, *halves)]
    elif changes_no_ray(model, known):
        lights = [reflected_lights(model, known, of, views) for of in (layers, *halves)]
    else:
        lights = engine_lights(model, known, engines(capture), layers, views, cache or LayerCache(), progress)
    fit, expected = predict_under_model(capture, model, lights, views, counted)
    predictions = {key: (0.5 * (a + b)).astype(np.float32) for key, (a, b) in expected.items()}
    seen = {(f, e): (views[f, e].frame, layers[f][e], image) for (f, e), image in measured.items()}
    noise_variances, noise_model = noise_variances_of(
        capture, views, measured, predictions, fit.nuisances.black_dn, unsteady_light(seen)
    )
    sums = {key: _sums_of(counted[key], expected[key], noise_variances.get(key)) for key in measured}
    return ImageErrors(capture, model, layers, views, measured, fit, predictions, noise_variances, noise_model, sums)


def _where_known(view: View, image: NDArray) -> NDArray:
    """The image with NaN where the scene is not known: what is not there to be expected counts nowhere."""
    return image if view.known is None else np.where(view.known, image, np.float32(np.nan))


def _sums_of(measured: np.ndarray, halves: Sequence[np.ndarray], floor: Any) -> dict[str, Any]:
    """Sums of squares of one image, to be pooled over cameras and frames. halves: expected, of half the samples
    each. measured: NaN where it is not to count."""
    counts = np.isfinite(measured)
    halves = [half[counts] for half in halves]
    residual = measured[counts] - 0.5 * (halves[0] + halves[1])
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
