# SPDX-License-Identifier: Apache-2.0
"""Renders the poses of a capture into light layers, once per distinct pose, through the cache.

A renderer is any callable (RenderRequest, progress) -> tuple of Layers (one per camera) with a `version` text that
changes whenever its pixels may change.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias

import numpy as np

import kuafu
from activestereo.capture.capture import SIDES, Capture, Frame
from activestereo.capture.capture_json import CaptureError
from activestereo.common.grouped import grouped
from activestereo.common.progress_bar import Progress, part_of
from activestereo.compare.cache import LayerCache
from activestereo.effects.core.resample import SupersampledImages
from activestereo.effects.core.view import Layers
from activestereo.effects.engines.layers import RenderRequest, request_key, rig_request, sampling_of
from activestereo.effects.engines.smooth import halves

# {frame id: {side: Layers}}, and a pair of these from two independent halves of the samples.
LayersOfFrames: TypeAlias = Mapping[int, Mapping[str, Layers]]
Halves: TypeAlias = tuple[LayersOfFrames, LayersOfFrames]

# Image samples along a pixel's side if effects may warp the images, so that dots stay sharp.
WARP_SCALE = 2
# A draft takes so many times fewer samples.
_DRAFTED = 4


class Renderer(Protocol):
    """Renders the poses of a request: returns Layers, light by its source, for each camera."""

    version: str
    """Names all that decides its images: a cached render of another version is not used."""

    def __call__(self, request: RenderRequest, progress: Progress | None = None) -> tuple[Layers, ...]: ...


def render_frames(
    capture: Capture, renderer: Renderer, samples_per_pixel: int = 64, max_bounces: int = 8, seed: int = 0,
    cache: LayerCache | None = None, progress: Progress | None = None, scale: int = 1,
    frames: Sequence[Frame] | None = None,
) -> LayersOfFrames:  # fmt: skip
    """Renders the layers of all frames, or of `frames` alone; frames at one pose share their layers.

    A moving frame is rendered at its mid-exposure pose: motion within the exposure is an effect, not part of the base
    model. cache: None: the user's own. progress: called as progress(fraction done). scale: image samples along a
    pixel's side. From 2 on, supersampled images keep warps (lenses, calibration, motion) sharp up to the frame's
    border, at about 1.1 times the cost; light samples per pixel stay the same. Raises CaptureError for a nominal lens
    that folds back within the image.
    """
    [layers] = _rendered(capture, renderer, samples_per_pixel, max_bounces, (seed,), cache, progress, scale, frames)
    return layers


@dataclass(frozen=True)
class BaseRenders:
    """Renders the base model's light, supersampled, with the same settings on any capture. cache: None: the user's
    own."""

    renderer: Renderer
    samples_per_pixel: int
    max_bounces: int = 8
    seed: int = 0
    cache: LayerCache | None = None

    def halves(self, capture: Capture, frames: Sequence[Frame], progress: Progress | None = None) -> Halves:
        """Renders twice as render_frames() does, each time with half of the samples and independent random numbers."""
        half, seeds = halves(self.samples_per_pixel, self.seed)
        how = half, self.max_bounces, seeds, self.cache, progress, WARP_SCALE
        first, second = _rendered(capture, self.renderer, *how, frames)
        return first, second

    def for_fits(
        self, capture: Capture, frames: Sequence[Frame], progress: Progress | None, is_draft: bool
    ) -> LayersOfFrames:
        """Renders as render_frames() does, by the halves that errors are told from later. is_draft: renders with fewer
        samples, for poses that a search leaves again."""
        if is_draft:
            few = max(1, self.samples_per_pixel // _DRAFTED)
            how = few, self.max_bounces, self.seed, self.cache, progress, WARP_SCALE
            return render_frames(capture, self.renderer, *how, frames)
        layers: dict[int, Mapping[str, Layers]] = {}
        poses = grouped((frame.camera_to_world.tobytes(), frame) for frame in frames)
        for done, some in enumerate(poses):  # one by one, because halves of large images take gigabytes
            share = part_of(progress, done / len(poses), (done + 1) / len(poses))
            layers |= mean_of_halves(self.halves(capture, some, share))
        return layers


def _rendered(
    capture: Capture, renderer: Renderer, samples_per_pixel: int, max_bounces: int, seeds: Sequence[int],
    cache: LayerCache | None, progress: Progress | None, scale: int, frames: Sequence[Frame] | None,
) -> list[LayersOfFrames]:  # fmt: skip
    """Renders as render_frames() does, once for each seed. All seeds of a pose follow each other, because a renderer
    may keep parts that do not depend on the seed."""
    kept = cache or LayerCache()
    sampling = sampling_of(capture.rig, scale)
    requests: dict[str, RenderRequest] = {}
    keys: list[dict[int, str]] = [{} for _ in seeds]
    for frame in capture.frames if frames is None else frames:
        for seed, of_seed in zip(seeds, keys, strict=True):
            request = rig_request(capture, frame, samples_per_pixel, max_bounces, seed, sampling)
            of_seed[frame.id] = key = request_key(request, renderer.version)
            requests.setdefault(key, request)
    rendered = {}

    def finished(key: str, layers: tuple[Layers, ...], is_new: bool) -> Mapping[str, Layers]:
        if is_new:
            kept.put(key, layers)
        return dict(zip(SIDES, map(sampling.pixel_layers, layers) if sampling.scale > 1 else layers, strict=True))

    with ThreadPoolExecutor(1) as beside:  # the next request is rendered while the last one is stored
        for done, (key, request) in enumerate(requests.items()):
            layers = kept.get(key)
            is_new = layers is None
            if layers is None:
                try:
                    layers = renderer(request, part_of(progress, done / len(requests), (done + 1) / len(requests)))
                except kuafu.ArgumentError as error:
                    raise CaptureError(f"{capture.path / 'capture.json'}: rig: {error}") from error
            rendered[key] = beside.submit(finished, key, layers, is_new)
            if progress:
                progress((done + 1) / len(requests))
    return [{number: rendered[key].result() for number, key in of_seed.items()} for of_seed in keys]


def noise_square(first: np.ndarray, second: np.ndarray) -> float:
    """Returns the mean square of the renderer's noise in the mean of two half renders a and b, in the square of their
    unit. With a measurement m it is mean(((a + b) / 2 - m)^2) - mean((a - m) (b - m)). The second term is the squared
    error of a render without noise."""
    return float(np.mean((np.asarray(first, dtype=np.float64) - second) ** 2)) / 4.0


def mean_of_halves(halves: Halves, is_fine: bool = True) -> LayersOfFrames:
    """Returns the mean light of two half renders, with the first half's geometry. Frames with the same halves share the
    result. is_fine: with supersampled images, which take most of the memory."""
    known: dict[tuple[int, int], Layers] = {}
    names = "direct", "indirect", "ambient", "flat", "ambient_direct"

    def mean(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (0.5 * (a + b)).astype(np.float32)

    def of_view(first: Layers, second: Layers) -> Layers:
        if (key := (id(first), id(second))) not in known:
            pairs = {name: (getattr(first, name), getattr(second, name)) for name in names}
            light: dict[str, Any] = {name: mean(a, b) for name, (a, b) in pairs.items() if a is not None}
            fine, other = first.supersampled, second.supersampled
            if is_fine and fine is not None and other is not None:
                images = mean(fine.images(), other.images())
                light["supersampled"] = SupersampledImages(images, fine.scale, fine.margin_px)
            known[key] = replace(first, **{"supersampled": None} | light)
        return known[key]

    return {
        number: {side: of_view(first, halves[1][number][side]) for side, first in sides.items()}
        for number, sides in halves[0].items()
    }
