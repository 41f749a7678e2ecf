# SPDX-License-Identifier: Apache-2.0
"""Defines requests of renders and the images' resolution."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np

import kuafu
from activestereo.capture.capture import Capture, Frame, Rig
from activestereo.common.input_files import read_bytes, read_json
from activestereo.common.lens import lens_fields, with_finer_pixels
from activestereo.effects.core.resample import SupersampledImages
from activestereo.effects.core.view import Layers
from activestereo.effects.engines.capture_inputs import copy_record, record_key

# Increase this number when the meaning of a cached array changes.
_FORMAT = 4
# Margin rendered beyond the frame at finer scales, which calibration errors and motion bring into view.
_MARGIN_SHARE = 0.02
# Depths that differ by less than this share belong to one surface.
_SMOOTH_SHARE = 0.02


@dataclass(frozen=True)
class RenderRequest:
    """Everything that decides the pixels of one rig pose. projector: at 1 W/sr."""

    scene_path: Path
    cameras: tuple[kuafu.Camera, ...]
    projector: kuafu.Light
    pattern: np.ndarray
    samples_per_pixel: int
    max_bounces: int
    seed: int


@dataclass(frozen=True)
class Sampling:
    """The resolution of rendered images: scale x scale image points in each camera pixel, which share its light
    samples, and a margin of margin_px camera pixels around the frame."""

    scale: int = 1
    margin_px: int = 0

    def camera(self, camera: kuafu.Camera) -> kuafu.Camera:
        """Returns the camera that renders the finer, wider image of this camera."""
        width, height = ((size + 2 * self.margin_px) * self.scale for size in (camera.width, camera.height))
        k = with_finer_pixels(camera.k, self.scale)
        k[:2, 2] += self.margin_px * self.scale
        return copy_record(camera, width=width, height=height, k=k)

    def pixel_layers(self, layers: Layers) -> Layers:
        """Reduces the Layers rendered with camera() to the camera's pixels."""
        images = np.stack([layers.direct, layers.indirect, layers.ambient, layers.flat])
        supersampled = SupersampledImages(images, self.scale, self.margin_px)
        direct, indirect, ambient, flat = (image.astype(np.float32) for image in supersampled.pixels())
        sky = None if layers.ambient_direct is None else replace(supersampled, samples=layers.ambient_direct[None])
        ambient_direct = None if sky is None else sky.pixels()[0].astype(np.float32)
        # Normal and material at a pixel come from a sample at its centre. Where the scale is even, four samples meet
        # there; on smooth surfaces depth is their mean.
        first, steps = self.margin_px * self.scale + (self.scale - 1) // 2, range(2 - self.scale % 2)
        rows, columns = (first + self.scale * np.arange(size) for size in direct.shape)
        corners = np.stack([layers.depth_m[np.ix_(rows + down, columns + right)] for down in steps for right in steps])
        smooth = corners.max(axis=0) - corners.min(axis=0) < _SMOOTH_SHARE * corners.min(axis=0)
        depth_m = np.where(smooth, corners.mean(axis=0, dtype=np.float64), corners[0]).astype(np.float32)
        at = np.ix_(rows, columns)
        surfaces = depth_m, layers.normal[at], layers.material[at]
        own = SupersampledImages(images, self.scale, self.margin_px)  # another one, which does not keep pixels()
        return Layers(direct, indirect, ambient, flat, *surfaces, ambient_direct, own)


def sampling_of(rig: Rig, scale: int) -> Sampling:
    """Returns the Sampling for a scale: at 1 the pixels alone, else finer samples with a margin."""
    largest = max(max(camera.width, camera.height) for camera in (rig.left, rig.right))
    return Sampling() if scale == 1 else Sampling(scale, int(np.ceil(_MARGIN_SHARE * largest)))


def rig_request(
    capture: Capture, frame: Frame, samples_per_pixel: int, max_bounces: int, seed: int,
    sampling: Sampling = Sampling(),
) -> RenderRequest:  # fmt: skip
    """Returns the render request for a frame's pose: both cameras, and the projector that moves with the rig."""
    rig, pose = capture.rig, frame.camera_to_world
    poses = (rig.left, pose), (rig.right, pose @ np.linalg.inv(rig.left_to_right))
    projector_to_world = pose @ np.linalg.inv(rig.projector.left_to_projector)
    return RenderRequest(
        capture.scene_path,
        tuple(
            sampling.camera(kuafu.Camera(c.width, c.height, c.K, place, **lens_fields(c.distortion)))
            for c, place in poses
        ),
        kuafu.Light(kind="projector", k=rig.projector.K, ir_intensity=1.0, light_to_world=projector_to_world),
        rig.projector.pattern(),
        max(1, round(samples_per_pixel / sampling.scale**2)),
        max_bounces,
        seed,
    )


def scene_digest(scene_path: str | Path) -> str:
    """Returns a content hash of a glTF scene and every file it refers to."""
    digest = hashlib.sha256()
    path = Path(scene_path)
    digest.update(read_bytes(path))
    if path.suffix == ".gltf":
        document = read_json(path)
        for kind in ("buffers", "images"):  # entries without the right shape are the importer's to refuse
            entries = document.get(kind) if isinstance(document, dict) else None
            for entry in entries if isinstance(entries, list) else ():
                uri = entry.get("uri") if isinstance(entry, dict) else None
                if isinstance(uri, str) and uri and not uri.startswith("data:"):
                    digest.update(read_bytes(path.parent / unquote(uri)))
    return digest.hexdigest()


def request_key(request: RenderRequest, renderer_version: str) -> str:
    """Returns a hash of a RenderRequest and the renderer's version. Requests with equal keys give equal layers."""
    records = [record_key(record) for record in (*request.cameras, request.projector)]
    samples = request.samples_per_pixel, request.max_bounces, request.seed
    pattern = np.ascontiguousarray(request.pattern)
    key = _FORMAT, renderer_version, scene_digest(request.scene_path), records, samples, pattern.dtype, pattern.shape
    return hashlib.sha256(repr(key).encode() + pattern.tobytes()).hexdigest()
