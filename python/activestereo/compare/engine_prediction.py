# SPDX-License-Identifier: Apache-2.0
"""Computes a capture's expected images under a model with the engines: effects with engine fields act inside kuafu and
simsense. Lens blur, falloff, glare and the imager's effects change no ray, so they reuse the base model's rendered
light."""

from __future__ import annotations

import functools
import hashlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Capture, Frame, ImageKey, usual_samples
from activestereo.common.progress_bar import Progress, part_of
from activestereo.compare.cache import LayerCache
from activestereo.effects import Light, Model, View, engines
from activestereo.effects.core.view import Layers
from activestereo.effects.engines import CaptureRenderer, SceneMeasurement, loaded_scene
from activestereo.effects.engines.layers import scene_digest
from activestereo.effects.engines.smooth import HALVES, halves

# The light on the imager by (half of the samples: 0 or 1, that half's base layers of one camera, their view).
LightOf: TypeAlias = Callable[[int, Layers, View], Light]

# Albedo factors this close to 1 hardly change the light that bounces between surfaces.
_NEAR_ALBEDO = 0.05
# Engine fields of effects that add lights and change nothing else.
_ADDED = {"lights", "rig_lights"}
# Most samples per pixel of a model's images.
_ENOUGH = 16


def engines_of(
    device: str | int, samples_per_pixel: int | None, max_bounces: int, seed: int
) -> Callable[[Capture], CaptureRenderer]:
    """Returns a function that makes a capture's CaptureRenderer for a model's images. It renders with half of
    samples_per_pixel (None: usual_samples()), at most 16. Render noise is then at most half of a sensor's noise, and
    all reported errors exclude it."""

    def engines(capture: Capture) -> CaptureRenderer:
        samples = min(halves(samples_per_pixel or usual_samples(capture), seed)[0], _ENOUGH)
        return CaptureRenderer(device, samples, max_bounces, seed)

    return engines


def engine_changes(
    capture: Capture, device: str | int, samples_per_pixel: int | None, max_bounces: int, seed: int
) -> Callable[..., Mapping[ImageKey, NDArray[np.float32]]]:
    """Returns a function that renders how a model's effects change the light of a capture's train frames, and stores it
    in the user's cache (a Rendering of diagnose/refit.py). It takes an eighth of the samples, because a search compares
    images with the same random numbers; its argument `samples` multiplies them. Arguments are those of engines_of()."""
    usual, cache = max(1, (samples_per_pixel or usual_samples(capture)) // 8), LayerCache()
    frames = capture.split("train")
    renderer = functools.cache(lambda samples: CaptureRenderer(device, usual * samples, max_bounces, seed))
    base = functools.cache(lambda renderer: kept_lights(capture, renderer, cache, Model(), frames))

    def changes(model: Model, samples: int = 1) -> Mapping[ImageKey, NDArray[np.float32]]:
        if all(set(effect.engine_fields) <= _ADDED for effect, _ in model.effects):
            return kept_lights(capture, renderer(samples), cache, model, frames, added_alone=True)
        by = renderer(samples).filtering_alike(capture, model)
        return {key: image - base(by)[key] for key, image in kept_lights(capture, by, cache, model, frames).items()}

    return changes


def kept_lights(
    capture: Capture, renderer: CaptureRenderer, cache: LayerCache, model: Model, frames: Sequence[Frame],
    scene_measurement: SceneMeasurement | None = None, progress: Progress | None = None,
    half: int | None = None, added_alone: bool = False,
) -> dict[ImageKey, NDArray[np.float32]]:  # fmt: skip
    """Renders the light on the frames under a model, or reads it from the cache; returns {(frame id, side): images
    [3][height][width] of direct, indirect and ambient light}. half: 0 or 1 renders one half of the samples; None: all
    samples. added_alone: renders the lights alone that the model's effects add, as ambient light."""
    own = renderer.lights_key(renderer.inputs(capture, model, frames, scene_measurement), half), added_alone
    code = [inspect.getsource(module) for _, module in inspect.getmembers(engines, inspect.ismodule)]
    of_world = scene_digest(capture.scene_path), loaded_scene.engine_version(renderer.device)
    key = hashlib.sha256(repr((own, code, of_world)).encode()).hexdigest()
    stored = cache.get_arrays(key)
    if stored is None:
        if added_alone:
            added = renderer.added_light(capture, model, frames)
            lights = {key: (0.0 * image, 0.0 * image, image) for key, image in added.items()}
        else:
            seen = renderer.lights(capture, model, frames, scene_measurement, progress, half)
            lights = {key: (x.direct, x.indirect, x.ambient) for key, x in seen.items()}
        stored = {f"{side}_{id}": np.stack(images) for (id, side), images in lights.items()}
        cache.put_arrays(key, stored)
    names = ((name, *name.split("_")) for name in stored)
    return {(int(id), side): stored[name] for name, side, id in names}


def engine_lights(
    capture: Capture, model: Model, scene_measurement: SceneMeasurement, renderer: CaptureRenderer, cache: LayerCache,
    progress: Progress | None = None,
) -> LightOf:  # fmt: skip
    """Renders a model's light on the imager in two independent halves of the samples. Returns a function of (half: 0 or
    1, that half's base layers of one camera, their view). The light is the base model's plus the difference of two
    renders with the same random numbers, with and without the model. Errors of two models then differ by the models
    alone, not by how each is rendered. Effects that the engines lack are applied by their formulas. cache: stores the
    renders."""
    outside = _on_images(model)
    traced = model.only(lambda *pair: pair not in outside.effects)
    renderer = renderer.filtering_alike(capture, traced)

    def render(half: int, model: Model, known: SceneMeasurement | None, step: int) -> Mapping[ImageKey, NDArray]:
        share = part_of(progress, (2 * half + step) / 4, (2 * half + step + 1) / 4)
        return kept_lights(capture, renderer, cache, model, capture.frames, known, share, half)

    def change(half: int) -> Mapping[ImageKey, NDArray[np.float32]]:
        without = render(half, Model(), None, 0)
        return {key: image - without[key] for key, image in render(half, traced, scene_measurement, 1).items()}

    changes = [change(half) for half in HALVES]

    def light(half: int, layers: Layers, view: View) -> Light:
        images = np.array(Light.of(layers).images, dtype=np.float64)
        images[:-1] += changes[half][view.frame.id, view.side]  # all but `flat`
        return outside.light(Light.of_images(images), view)

    return light


def changes_no_ray(model: Model, scene_measurement: SceneMeasurement) -> bool:
    """Returns whether a model and the measured scene leave all rays of the base model as they are. Then its rendered
    layers can be reused, scaled by the surfaces' albedos."""
    near = all(abs(factor - 1.0) <= _NEAR_ALBEDO for factor in scene_measurement.albedo.values())
    moved = any(scene_measurement.focal) or scene_measurement.surfaces
    return near and not moved and _on_images(model).on_light() == model.on_light()


def _on_images(model: Model) -> Model:
    """Returns a model of the effects that are applied to rendered light: those that the engines lack, and those of the
    lens' optics alone, which kuafu, too, applies to its finished images."""
    return model.only(lambda e, p: not e.is_simulated(p) or all("optics." in name for name in e.engine_fields))
