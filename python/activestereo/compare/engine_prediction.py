# SPDX-License-Identifier: Apache-2.0
"""A capture's expected images under a model by the engines themselves: effects with engine fields act inside of kuafu
and simsense. Effects behind the lens change no ray: the base model's light is theirs."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.binning import usual_samples
from activestereo.capture.capture import SIDES, Capture, Frame, ImageKey
from activestereo.common.progress_bar import part_of
from activestereo.compare.cache import LayerCache, scene_digest
from activestereo.compare.layers import Layers
from activestereo.effects import Light, Model, View
from activestereo.effects.engines import CaptureRenderer, SceneMeasurement, capture_renderer, scene_renderer
from activestereo.effects.engines.smooth import HALVES, half_samples

# Albedos within so much of the scene's hardly change bounced light but by the surface that sends it to the camera.
_NEAR_ALBEDO = 0.05


def engines_of(
    device: str | int, samples_per_pixel: int | None, max_bounces: int, seed: int
) -> Callable[[Capture], CaptureRenderer]:
    """Makes the engines of a capture for a model's images. They take half of the samples: 32 leave a third of a
    sensor's noise at most, and no figure contains it. samples_per_pixel: None for usual_samples()."""

    def engines(capture: Capture) -> CaptureRenderer:
        samples = half_samples(samples_per_pixel or usual_samples(capture))
        return CaptureRenderer(capture, device, samples, max_bounces, seed)

    return engines


class EngineImages:
    """The light of a capture's train frames under a model by the engine (a Rendering of diagnose/search/rendered.py).
    Images are kept in the user's cache of renders.

    Arguments as of engines_of(). A search looks at differences of images with the same random numbers: an eighth of the
    samples are enough.
    """

    def __init__(
        self, capture: Capture, device: str | int, samples_per_pixel: int | None, max_bounces: int, seed: int
    ) -> None:
        samples = max(1, (samples_per_pixel or usual_samples(capture)) // 8)
        self._renderer = CaptureRenderer(capture, device, samples, max_bounces, seed)
        self._cache = LayerCache()

    def __call__(self, model: Model) -> Mapping[ImageKey, LightOnly]:
        return kept_lights(self._renderer, self._cache, model, self._renderer.capture.split("train"))


class LightOnly(NamedTuple):
    """Radiance float32 [height][width], as CameraLight has it."""

    direct: NDArray[np.float32]
    indirect: NDArray[np.float32]
    ambient: NDArray[np.float32]


def kept_lights(
    renderer: CaptureRenderer, cache: LayerCache, model: Model, frames: Sequence[Frame],
    scene_measurement: SceneMeasurement | None = None, progress: Callable[[float], object] | None = None,
    half: int | None = None,
) -> dict[ImageKey, LightOnly]:  # fmt: skip
    """renderer.lights(), kept in a cache by all that decides them, the code that makes them included."""
    code = [inspect.getsource(module) for module in (capture_renderer, scene_renderer)]
    own = renderer.lights_key(model, frames, scene_measurement, half), code
    of_world = scene_digest(renderer.capture.scene_path), scene_renderer.engine_version(renderer.device)
    key = hashlib.sha256(repr((own, of_world)).encode()).hexdigest()
    stored = cache.get_arrays(key)
    if stored is None:
        seen = renderer.lights(model, frames, scene_measurement, progress=progress, half=half)
        stored = {f"{side}_{id}": np.stack([x.direct, x.indirect, x.ambient]) for (id, side), x in seen.items()}
        cache.put_arrays(key, stored)
    return {(f.id, side): LightOnly(*stored[f"{side}_{f.id}"]) for f in frames for side in SIDES}


def engine_lights(
    model: Model, scene_measurement: SceneMeasurement, renderer: CaptureRenderer,
    layers: Mapping[int, Mapping[str, Layers]], views: Mapping[ImageKey, View], cache: LayerCache,
    progress: Callable[[float], object] | None = None,
) -> list[dict[ImageKey, Light]]:  # fmt: skip
    """{(frame id, side): the light on the imager}: the mean, and each of two independent halves of the samples. Effects
    without engine fields act on the rendered light. layers: the base model's; cache: of the light."""
    outside, halves = model.outside_engines(), []
    for half in HALVES:
        share = part_of(progress, half / 2, (half + 1) / 2)
        seen = kept_lights(renderer, cache, model, renderer.capture.frames, scene_measurement, share, half)
        lights = {}
        for key, view in views.items():
            images = (*seen[key], layers[key[0]][key[1]].flat)
            light = Light.of_images([np.asarray(image, dtype=np.float64) for image in images])
            lights[key] = outside.light(light, view)
        halves.append(lights)
    means = {key: Light.of_images(0.5 * (halves[0][key].images + halves[1][key].images)) for key in views}
    return [means, *halves]


def changes_no_ray(model: Model, scene_measurement: SceneMeasurement) -> bool:
    """Whether a model's light is the base model's, but for the shares that surfaces reflect."""
    near = all(abs(factor - 1.0) <= _NEAR_ALBEDO for factor in scene_measurement.albedo.values())
    moved = any(scene_measurement.focal) or scene_measurement.surfaces
    return near and not moved and all(effect.engine is None for effect, _ in model.on_light())


def reflected_lights(
    model: Model,
    scene_measurement: SceneMeasurement,
    layers: Mapping[int, Mapping[str, Layers]],
    views: Mapping[ImageKey, View],
) -> dict[ImageKey, Light]:
    """engine_lights() of one half, of a model that changes no ray. layers: the base model's."""

    def light(number: int, side: str, view: View) -> Light:
        own = layers[number][side]
        gain = np.ones(view.shape)
        for material, factor in scene_measurement.albedo.items():
            gain[own.material == material] = factor
        return model.light(Light.of_images(gain * np.stack([own.direct, own.indirect, own.ambient, own.flat])), view)

    return {(number, side): light(number, side, view) for (number, side), view in views.items()}
