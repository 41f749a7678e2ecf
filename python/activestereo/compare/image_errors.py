# SPDX-License-Identifier: Apache-2.0
"""Computes the errors of a model's expected infrared images, for `compare` and `diagnose`. Classifies their shape:
smooth brightness; weaker, blurred or displaced dots; or another one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, laplace

from activestereo.capture.capture import SIDES, SPLITS, Capture, Frame, ImageKey
from activestereo.capture.images import block_means
from activestereo.common.grouped import grouped
from activestereo.common.progress_bar import Progress, part_of
from activestereo.compare.cache import LayerCache
from activestereo.compare.engine_prediction import LightOf, changes_no_ray, engine_lights
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.noise import NoiseModel, noise_of_images
from activestereo.compare.nuisances import Fit, fit_with_exposures
from activestereo.compare.render import BaseRenders, LayersOfFrames, mean_of_halves, noise_square
from activestereo.effects.core.light import Light
from activestereo.effects.core.model import Model
from activestereo.effects.core.view import Layers, View
from activestereo.effects.engines import CaptureRenderer, SceneMeasurement

_SMOOTH_PX = 6.0  # wider than dots, narrower than changes by lights and lenses
_BLOCK_PX = 32
# Least share of the squared error beyond noise that a named shape explains; below it the shape is "other".
_LEAST_SHARE = 0.25


@dataclass(frozen=True)
class ErrorShape:
    """Names the kind of change that explains most of an image error. kind: "brightness" (smooth), "dots" (contrast),
    "sharpness", "place" (displacement) or "other". share: part of the squared error beyond noise that it explains.
    amount: measured minus expected, in DN, share of the dots' contrast, px² of blur, or px (unsigned)."""

    kind: str
    share: float
    amount: float


def error_shape(images: Iterable[tuple[NDArray, NDArray, float, NDArray[np.bool_]]]) -> ErrorShape | None:
    """Finds the ErrorShape of images: (measured DN, expected DN, noise variance in DN², mask of the known scene),
    [height][width]. Returns None if the error does not exceed noise."""
    sums = {kind: [0.0, 0.0, 0.0] for kind in ("brightness", "dots", "sharpness", "place")}
    beyond = 0.0
    for measured, expected, floor, mask in images:
        residual = np.where(mask, measured - expected, 0.0)
        smooth = _smoothed(residual, mask)
        detail = expected - _smoothed(np.where(mask, expected, 0.0), mask)
        rest = np.where(mask, residual - smooth, 0.0)
        beyond += float((residual**2).sum() - floor * mask.sum())
        sums["brightness"][0] += float((smooth[mask] ** 2).sum())
        sums["brightness"][1] += float(smooth[mask].sum())
        sums["brightness"][2] += float(mask.sum())
        starts = [np.arange(0, size, _BLOCK_PX) for size in rest.shape]
        gradients = [np.gradient(expected, axis=axis) for axis in (0, 1)]
        for kind, templates in (("dots", [detail]), ("sharpness", [laplace(expected)]), ("place", gradients)):
            for template in templates:
                # In each block: the squares beyond noise that the template explains, and its weighted factor.
                template = np.where(mask, template, 0.0)
                cross, square = (
                    np.add.reduceat(np.add.reduceat(x, starts[0], axis=0), starts[1], axis=1)
                    for x in (rest * template, template**2)
                )
                used = square > 0.0
                explained = (cross[used] ** 2 / square[used] - floor).sum(), cross[used].sum(), square[used].sum()
                sums[kind] = [before + float(more) for before, more in zip(sums[kind], explained, strict=True)]
    if beyond <= 0.0:
        return None
    shares = {kind: own[0] / beyond for kind, own in sums.items()}
    kind = max(shares, key=lambda name: shares[name])
    share = shares[kind]
    _, weighted, weight = sums[kind]
    amount = weighted / max(weight, 1e-12)
    if kind == "place":  # both ways are displaced: the size alone
        amount = float(np.sqrt(sums[kind][0] / max(weight, 1e-12)))
    return ErrorShape(kind if share >= _LEAST_SHARE else "other", min(float(share), 1.0), float(amount))


def _smoothed(image: NDArray, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    weight = gaussian_filter(mask.astype(np.float64), _SMOOTH_PX)
    return gaussian_filter(image.astype(np.float64), _SMOOTH_PX) / np.maximum(weight, 1e-6)


@dataclass(frozen=True)
class ImageErrors:
    """A model's expected images (predictions) and the measured ones, {(frame id, side): [height][width]}, DN.
    squares: squared errors less the renderer's noise (noise_square()), DN^2, of the same shape; NaN where the scene is
    unknown.

    layers: the base model's light, {frame id: {side: Layers}}, the mean of two renders with half of the samples each.
    fit: the nuisances under the model, fitted to the train frames. noise_variances: {(frame id, side): (variance in
    DN^2, its source)}."""

    capture: Capture
    model: Model
    layers: LayersOfFrames
    views: dict[ImageKey, View]
    measured: dict[ImageKey, NDArray]
    fit: Fit
    predictions: dict[ImageKey, NDArray[np.float32]]
    squares: dict[ImageKey, NDArray[np.float32]]
    noise_variances: dict[ImageKey, tuple[float, str]]
    noise_model: NoiseModel | None
    _sums: dict[ImageKey, dict[str, Any]]

    def residuals(self) -> dict[ImageKey, NDArray[np.float32]]:
        """Returns {(frame id, side): measured minus expected, DN, float32 [height][width]}."""
        return {key: self.measured[key].astype(np.float32) - image for key, image in self.predictions.items()}

    def forget(self) -> None:
        """Drops what views and light keep for further models; it is computed again where it is needed."""
        for view in self.views.values():
            view.forget()
        for layers in (layers for sides in self.layers.values() for layers in sides.values()):
            layers.forget()

    def squares_of_blocks(self, key: ImageKey, size: int) -> NDArray[np.float32]:
        """Returns `squares` of the image averaged over blocks of size x size pixels. The renderer's noise is
        independent from pixel to pixel."""
        if size == 1:
            return self.squares[key]
        residual = self.measured[key] - self.predictions[key]
        noise = block_means(residual**2 - self.squares[key], size) / size**2
        return block_means(residual, size) ** 2 - noise

    def by_split(self) -> dict[str, dict[str, Any]]:
        """Returns {"train" or "test": errors pooled over its images, and for each camera}; a split without frames is
        left out."""
        out = {}
        for split in SPLITS:
            if frames := self.capture.split(split):
                sources = {self._sums[frame.id, side]["floor_source"] for frame in frames for side in SIDES} - {None}
                more = {"noise_floor_from": sorted(sources), "frames": [frame.id for frame in frames]}
                out[split] = self._pooled(frames, more)
        return out

    def by_frame(self) -> list[dict[str, Any]]:
        """Returns the errors of every frame, pooled and for each camera."""
        return [
            {"id": frame.id, "split": frame.split}
            | self._pooled([frame], {"noise_floor_from": self._sums[frame.id, "left"]["floor_source"]})
            for frame in self.capture.frames
        ]

    def _pooled(self, frames: Sequence[Frame], more: dict[str, Any]) -> dict[str, Any]:
        """Returns errors pooled over frames and cameras, the entries of `more`, and "cameras": errors of each
        camera."""
        own = {side: [self._sums[frame.id, side] for frame in frames] for side in SIDES}
        cameras = {side: _pool(images) for side, images in own.items()}
        return _pool([*own["left"], *own["right"]]) | more | {"cameras": cameras}


@dataclass(frozen=True)
class Judged:
    """A model whose images are computed. engines: makes a CaptureRenderer, which renders the model's effects; None:
    effects change images by formulas. known: measured focal lengths and albedos, which only engines use."""

    model: Model
    engines: Callable[[Capture], CaptureRenderer] | None = None
    known: SceneMeasurement | None = None

    def measured(self) -> SceneMeasurement:
        """Returns `known`, or an empty SceneMeasurement without it or without engines."""
        return SceneMeasurement() if self.engines is None or self.known is None else self.known

    def is_traced(self) -> bool:
        """Returns whether engines render the model's light."""
        return self.engines is not None and not changes_no_ray(self.model, self.measured())

    def lights(self, capture: Capture, cache: LayerCache, progress: Progress | None) -> LightOf:
        """Returns a function of (half of the samples: 0 or 1, base layers of one camera, their view): the model's light
        on the imager."""
        known = self.measured()
        if self.engines is not None and self.is_traced():
            return engine_lights(capture, self.model, known, self.engines(capture), cache, progress)

        def light(half: int, layers: Layers, view: View) -> Light:
            gain = np.ones(view.shape)
            for material, factor in known.albedo.items():
                gain[layers.material == material] = factor
            scaled = Light.of_images(gain * Light.of(layers).images) if known.albedo else Light.of(layers)
            return self.model.light(scaled, view)

        return light


def image_errors(
    capture: Capture, judged: Sequence[Judged], renders: BaseRenders, progress: Progress | None = None
) -> list[ImageErrors]:
    """Computes the ImageErrors of models, after fitting each one's nuisances to the train frames. Raises CaptureError
    if there is nothing to fit.

    Poses follow each other, because the layers of many large images take gigabytes. renders: renders the base model's
    light in two halves; its cache stores the engines' light, too. progress: called as progress(fraction done)."""
    poses = grouped((frame.camera_to_world.tobytes(), frame) for frame in capture.frames)
    parts = sum(j.is_traced() for j in judged) + 1  # of the progress; the last is for the base model's light
    shares = (part_of(progress, i / parts, (i + 1) / parts) for i in range(parts))
    kept = renders.cache or LayerCache()
    lights = [j.lights(capture, kept, next(shares) if j.is_traced() else None) for j in judged]
    last = next(shares)
    mean: dict[int, Mapping[str, Layers]] = {}
    views: dict[ImageKey, View] = {}
    sent: list[dict[ImageKey, NDArray[np.float32]]] = [{} for _ in judged]
    for done, frames in enumerate(poses):
        halves = renders.halves(capture, frames, part_of(last, done / len(poses), (done + 1) / len(poses)))
        mean |= mean_of_halves(halves, is_fine=False)
        for frame, side in ((frame, side) for frame in frames for side in SIDES):
            key, both = (frame.id, side), [half[frame.id][side] for half in halves]
            view = views[key] = View.of(capture, frame, side, mean[frame.id][side], renders.seed)
            for light, images in zip(lights, sent, strict=True):
                seen = (light(half, layers, view) for half, layers in enumerate(both))
                images[key] = np.array([(x.projector, x.ambient) for x in seen], dtype=np.float32)
    return [_errors(capture, j.model, mean, views, images) for j, images in zip(judged, sent, strict=True)]


def _errors(
    capture: Capture, model: Model, layers: LayersOfFrames, views: dict[ImageKey, View],
    sent: Mapping[ImageKey, NDArray[np.float32]],
) -> ImageErrors:  # fmt: skip
    """Computes one model's ImageErrors. sent: of each half of the samples, the projector's light on the imager and the
    ambient light, [2][2][height][width]."""
    images = [
        MeasuredImage(f, side, views[f.id, side], layers[f.id][side], capture.ir(f, side))
        for f in capture.frames
        for side in SIDES
    ]
    measured = {image.key: image.measured for image in images}
    # Pixels whose scene is unknown have no expected value, so they count nowhere.
    counted = {image.key: image.where_known() for image in images}
    means = {key: _light(both.mean(axis=0)) for key, both in sent.items()}
    fit, seen = fit_with_exposures(capture, model, means, views, counted)
    predictions, squares, sums = {}, {}, {}  # sums over each image's pixels, to be pooled over cameras and frames
    for key, image in counted.items():
        first, second = (model.signal(_light(half), seen[key], fit.nuisances) for half in sent[key])
        predictions[key] = (0.5 * (first + second)).astype(np.float32)
        squares[key] = ((image - first) * (image - second)).astype(np.float32)
        counts = np.isfinite(image)
        residual = (image - 0.5 * (first + second))[counts]
        sums[key] = {
            "squares": float((residual**2).sum()),
            "noise_squares": noise_square(first[counts], second[counts]) * residual.size,
            "sum": float(residual.sum()),
            "pixels": residual.size,
        }
    noise_variances, noise_model = noise_of_images(capture, images, predictions, fit.nuisances.black_dn)
    for key, of_image in sums.items():
        of_image["floor_variance"], of_image["floor_source"] = noise_variances.get(key, (None, None))
    return ImageErrors(
        capture, model, layers, views, measured, fit, predictions, squares, noise_variances, noise_model, sums
    )


def _light(sent: NDArray[np.float32]) -> Light:
    """Returns the light whose projector part and ambient part are two images, [2][height][width]."""
    projector, ambient = sent.astype(np.float64)
    none = np.zeros(projector.shape)
    return Light(projector, none, ambient, none)


def _pool(images: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Returns errors pooled over images, DN: RMSE without the renderer's noise, bias, the renderer's noise, the
    measurement's noise floor, and sqrt(RMSE^2 - floor^2). The last two are None if an image has no floor."""
    pixels, squares, noise = (sum(image[name] for image in images) for name in ("pixels", "squares", "noise_squares"))
    rmse = float(np.sqrt(max(squares - noise, 0.0) / pixels))
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
