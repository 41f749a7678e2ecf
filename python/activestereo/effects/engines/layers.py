# SPDX-License-Identifier: Apache-2.0
"""Requests of renders: all that decides the images of one rig pose, and the resolution at which they are rendered."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np

import kuafu
from activestereo.capture.capture import SIDES, Camera, Capture, Frame, Rig
from activestereo.common.input_files import read_bytes, read_json
from activestereo.common.lens import is_drawn, to_pixels, to_tangents
from activestereo.effects.core.resample import SupersampledImages
from activestereo.effects.core.view import Layers
from activestereo.effects.engines.capture_inputs import record_key

# Increase this number when the meaning of a cached array changes.
_FORMAT = 4
# Margin rendered beyond the frame at finer scales, which calibration errors, lenses and motion bring into view.
_MARGIN_SHARE = 0.02
_LARGEST_MARGIN_PX = 200
# If undistorting and then distorting a border pixel misses it by this much, the lens model folds over there.
_LARGEST_FOLD_PX = 1.0
# Lens distortion is applied by resampling, which needs supersampled images.
_LEAST_SCALE_OF_A_LENS = 2
# Depths that differ by less than this share belong to one surface.
_SMOOTH_SHARE = 0.02


@dataclass(frozen=True)
class RenderRequest:
    """Everything that decides the pixels of one rig pose: pinhole cameras, the projector at 1 W/sr and its pattern, and
    samples. Requests with equal keys give equal layers."""

    scene_path: Path
    cameras: tuple[kuafu.Camera, ...]
    projector: kuafu.Light
    pattern: np.ndarray
    samples_per_pixel: int
    max_bounces: int
    seed: int


@dataclass(frozen=True)
class Sampling:
    """The resolution of rendered images: scale x scale image points in each camera pixel, and a margin of margin_px
    camera pixels around the frame.

    The number of light samples per camera pixel stays the same; they are spread over its image points.
    """

    scale: int = 1
    margin_px: int = 0

    def camera(self, camera: kuafu.Camera) -> kuafu.Camera:
        """Returns the camera that renders the finer, wider image of this camera."""
        if self.scale == 1 and self.margin_px == 0:
            return camera
        shift = self.margin_px + 0.5
        to_fine = np.array(
            [[self.scale, 0, self.scale * shift - 0.5], [0, self.scale, self.scale * shift - 0.5], [0, 0, 1.0]]
        )
        width, height = ((size + 2 * self.margin_px) * self.scale for size in (camera.width, camera.height))
        return kuafu.Camera(width, height, to_fine @ camera.k, camera.camera_to_world)

    def pixel_layers(self, layers: Layers, camera: Camera) -> Layers:
        """Reduces the Layers rendered with camera() to the pixels of a capture's Camera; applies its lens
        distortion."""
        images = np.stack([layers.direct, layers.indirect, layers.ambient, layers.flat])
        supersampled = SupersampledImages(images, self.scale, self.margin_px)
        sky = None if layers.ambient_direct is None else replace(supersampled, samples=layers.ambient_direct[None])
        column, row = np.meshgrid(np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64))
        if not camera.is_pinhole:
            column, row = ideal_pixels(camera, column, row)
            supersampled, sky = supersampled.warped(column, row), sky and sky.warped(column, row)
        direct, indirect, ambient, flat = (image.astype(np.float32) for image in supersampled.pixels())
        ambient_direct = None if sky is None else sky.pixels()[0].astype(np.float32)
        # Depth, normal and material at a pixel come from the nearest sample; on smooth surfaces depth is interpolated.
        shape = layers.depth_m.shape
        at = ((x + self.margin_px + 0.5) * self.scale - 0.5 for x in (row, column))
        exact = [np.clip(x, 0, size - 1.001) for x, size in zip(at, shape, strict=True)]
        (v, u), (dv, du) = zip(*((x.astype(int), x - x.astype(int)) for x in exact), strict=True)
        corners = np.stack(
            [layers.depth_m[v, u], layers.depth_m[v, u + 1], layers.depth_m[v + 1, u], layers.depth_m[v + 1, u + 1]]
        )
        mean = (1 - dv) * ((1 - du) * corners[0] + du * corners[1]) + dv * ((1 - du) * corners[2] + du * corners[3])
        near_v, near_u = v + (dv > 0.5), u + (du > 0.5)
        nearest = layers.depth_m[near_v, near_u]
        smooth = corners.max(axis=0) - corners.min(axis=0) < _SMOOTH_SHARE * corners.min(axis=0)
        depth_m = np.where(smooth, mean, nearest).astype(np.float32)
        surfaces = depth_m, layers.normal[near_v, near_u], layers.material[near_v, near_u]
        return Layers(direct, indirect, ambient, flat, *surfaces, ambient_direct, supersampled)


def ideal_pixels(camera: Camera, column: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Removes lens distortion: returns the (column, row) in an ideal pinhole image with the same K for pixels of a
    Camera."""
    return to_pixels(*to_tangents(column, row, camera.K, camera.distortion), camera.K)


def sampling_of(rig: Rig, scale: int) -> Sampling:
    """Returns the Sampling for a scale: at 1 the pixels alone, else finer samples with a margin that suffices for the
    rig's nominal lenses. Lenses that distort need at least scale 2. Raises ValueError for one that distorts too
    much."""
    cameras = [rig.camera(side) for side in SIDES]
    if scale == 1 and all(camera.is_pinhole for camera in cameras):
        return Sampling()
    reach = 0.0  # how far beyond the ideal frames the distorted ones look, pixels
    for camera in cameras:
        if camera.is_pinhole:
            continue
        right, bottom = camera.width - 1.0, camera.height - 1.0
        along = np.linspace(0.0, 1.0, 65)
        border_u = np.concatenate([along * right, along * right, 0 * along, 0 * along + right])
        border_v = np.concatenate([0 * along, 0 * along + bottom, along * bottom, along * bottom])
        with np.errstate(all="ignore"):  # a lens beyond all sense diverges
            u, v = ideal_pixels(camera, border_u, border_v)
            own = np.max([reach, -u.min(), -v.min(), u.max() - right, v.max() - bottom])
            x, y = to_tangents(u, v, camera.K)
            drawn = np.stack(to_pixels(x, y, camera.K, camera.distortion))
            fold_px = np.abs(drawn - [border_u, border_v]).max() if is_drawn(x, y, camera.distortion).all() else np.inf
        reach = float(own) if fold_px < _LARGEST_FOLD_PX and np.isfinite(own) else np.inf
    share = max(int(np.ceil(_MARGIN_SHARE * max(camera.width, camera.height))) for camera in cameras)
    if not reach <= _LARGEST_MARGIN_PX:
        how_far = f"{reach:.0f} pixels" if np.isfinite(reach) else "without limit"
        raise ValueError(
            f"the rig's lens distortion reaches {how_far} beyond an ideal camera's frame; at most "
            f"{_LARGEST_MARGIN_PX} pixels are rendered: rectify the images and give the rig's distortion as zeros"
        )
    return Sampling(max(scale, _LEAST_SCALE_OF_A_LENS), share + int(np.ceil(reach)))


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
        tuple(sampling.camera(kuafu.Camera(c.width, c.height, c.K, place)) for c, place in poses),
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
