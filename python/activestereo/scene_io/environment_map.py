# SPDX-License-Identifier: Apache-2.0
"""Reads environment maps: Radiance HDR and OpenEXR in linear radiance, PNG and JPEG in sRGB."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from activestereo.common import srgb
from activestereo.common.input_files import checked_file
from activestereo.scene_io.staging import ALL_SIDES

if TYPE_CHECKING:
    import kuafu

# A map's frame has row 0 along -y; a scene with y up turns it by half a turn about x, so that the middle column looks
# along -z, as a glTF camera does, and columns go towards +x.
MAP_TO_Y_UP = np.diag([1.0, -1.0, -1.0])


class EnvironmentMapError(ValueError):
    """Raised if an environment map is unusable. The message has the file and the remedy."""


def read_environment_map(path: str | Path) -> np.ndarray:
    """Reads an equirectangular image, twice as wide as high, as linear RGB radiance, float32 [height, width, 3]. Raises
    EnvironmentMapError."""
    path = Path(path)
    if not path.exists():
        raise EnvironmentMapError(f"{path}: there is no such file")
    # OpenCV reads OpenEXR only where the environment says so, for files that are not trusted.
    os.environ.setdefault("OPENCV_IO_ENABLE_OPENEXR", "1")
    import cv2

    try:
        pixels = cv2.imread(str(checked_file(path)), cv2.IMREAD_UNCHANGED)
    except (OSError, cv2.error) as error:
        raise EnvironmentMapError(f"{path}: cannot be read: {str(error).splitlines()[0]}") from error
    if pixels is None:
        raise EnvironmentMapError(f"{path}: is no image that can be read: .hdr, .exr, .png and .jpg can be")
    # OpenCV's image is grey or BGR or BGRA of any depth.
    height, width = pixels.shape[:2]
    if width != 2 * height:
        raise EnvironmentMapError(
            f"{path}: is {width}x{height} pixels, an equirectangular map is twice as wide as high"
        )
    channels = pixels[..., None] if pixels.ndim == 2 else pixels[..., :3][..., ::-1]
    rgb = np.broadcast_to(channels, (height, width, 3))
    if rgb.dtype.kind == "u":
        return srgb.linear(rgb.astype(np.float32) / np.iinfo(rgb.dtype).max)
    out = np.ascontiguousarray(rgb, np.float32)
    if not np.isfinite(out).all() or out.min() < 0:
        raise EnvironmentMapError(f"{path}: has radiances that are negative or not finite: clamp them in an editor")
    return out


def set_environment_map(scene: kuafu.Scene, path: str | Path, scale: float = 1.0) -> None:
    """Lights a scene with y up by the map in a file, times `scale`, in the light group ALL_SIDES. Raises
    EnvironmentMapError."""
    texture = scene.add_texture(read_environment_map(path), name=Path(path).name)
    scene.set_environment((scale, scale, scale), texture=texture, map_to_world=MAP_TO_Y_UP, light_group=ALL_SIDES)
