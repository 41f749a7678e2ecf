# SPDX-License-Identifier: Apache-2.0
"""Renders the poses of a capture into light layers, once per distinct pose, through the cache.

A renderer is any callable (RenderRequest, progress) -> tuple of Layers (one per camera) with a `version` text that
changes whenever its pixels may change.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, TypeAlias

from activestereo.capture.capture import SIDES, Capture, Frame
from activestereo.capture.capture_json import CaptureError
from activestereo.common.progress_bar import part_of
from activestereo.compare.cache import LayerCache, request_key
from activestereo.compare.layers import Layers, RenderRequest, rig_request, sampling_of
from activestereo.effects.engines.smooth import half_samples, half_seeds

# {frame id: {side: Layers}}, and of two independent halves of the samples.
LayersOfFrames: TypeAlias = Mapping[int, Mapping[str, Layers]]
Halves: TypeAlias = tuple[LayersOfFrames, LayersOfFrames]

# Image samples per pixel side where effects may warp the images: finer ones keep dots sharp.
WARP_SCALE = 2


class Renderer(Protocol):
    """Renders one rig pose; see the head of this file."""

    version: str
    """Names all that decides its images: a cached render of another version is not used."""

    def __call__(
        self, request: RenderRequest, progress: Callable[[float], object] | None = None
    ) -> tuple[Layers, ...]: ...


def render_frames(
    capture: Capture, renderer: Renderer, samples_per_pixel: int = 64, max_bounces: int = 8, seed: int = 0,
    cache: LayerCache | None = None, progress: Callable[[float], object] | None = None, scale: int = 1,
    frames: Sequence[Frame] | None = None,
) -> LayersOfFrames:  # fmt: skip
    """Layers of every frame, or of some; frames at one pose share their layers.

    A moving frame is rendered at its mid-exposure pose: motion within the exposure is an effect, not part of the base
    model. cache: a LayerCache, None for the user's own. progress: called as progress(fraction done). scale: image
    samples per pixel side; from 2 on the layers are PixelLayers, whose supersampled images keep warps (lenses,
    calibration, motion) sharp to the frame's border, at about 1.1 times the cost: the samples per pixel stay.
    ValueError for a nominal lens that distorts too much.
    """
    cache = cache or LayerCache()
    try:
        sampling = sampling_of(capture.rig, scale)
    except ValueError as error:
        raise CaptureError(f"{capture.path / 'capture.json'}: rig: {error}") from error
    requests: dict[str, RenderRequest] = {}
    keys = {}
    for frame in capture.frames if frames is None else frames:
        request = rig_request(capture, frame, samples_per_pixel, max_bounces, seed, sampling)
        keys[frame.id] = key = request_key(request, renderer.version)
        requests.setdefault(key, request)
    rendered = {}
    for done, (key, request) in enumerate(requests.items()):
        layers = cache.get(key)
        if layers is None:
            layers = renderer(request, part_of(progress, done / len(requests), (done + 1) / len(requests)))
            cache.put(key, layers)
        if sampling.scale > 1:
            layers = tuple(
                sampling.pixel_layers(view, capture.rig.camera(side)) for side, view in zip(SIDES, layers, strict=True)
            )
        rendered[key] = dict(zip(SIDES, layers, strict=True))
        if progress:
            progress((done + 1) / len(requests))
    return {frame_id: rendered[key] for frame_id, key in keys.items()}


def render_halves(
    capture: Capture, renderer: Renderer, samples_per_pixel: int = 64, max_bounces: int = 8, seed: int = 0,
    cache: LayerCache | None = None, progress: Callable[[float], object] | None = None, scale: int = 1,
    frames: Sequence[Frame] | None = None,
) -> Halves:  # fmt: skip
    """render_frames() twice with half of the samples each, from independent random numbers (render_noise.py)."""
    first, second = (
        render_frames(
            capture, renderer, half_samples(samples_per_pixel), max_bounces, own_seed, cache,
            part_of(progress, half / 2, (half + 1) / 2), scale, frames,
        )
        for half, own_seed in enumerate(half_seeds(seed))
    )  # fmt: skip
    return first, second
