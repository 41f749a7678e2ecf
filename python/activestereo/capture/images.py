# SPDX-License-Identifier: Apache-2.0
"""Reads and writes captures' image files: 8-bit or 16-bit gray and 8-bit colour. Errors name the file and the key."""

import struct
import zlib
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from activestereo.capture.capture_json import CaptureError
from activestereo.common.input_files import checked_file
from activestereo.common.output_files import write_png

_GRAY_MODES = ("L", "I;16", "I;16B", "I")
_COLOR_MODES = ("RGB", "RGBA", "LA", "P")
# Ten times more than any such camera has. A small file can claim far more pixels and exhaust memory.
_MOST_PIXELS = 1 << 26
# Pillow's errors for damaged bytes. Damaged chunks of a PNG are ValueErrors in some versions, struct.error in others.
_DAMAGES = (OSError, SyntaxError, ValueError, EOFError, struct.error, zlib.error)


def image_size(path: str | Path, key: str = "image") -> tuple[int, int]:
    """Reads (width, height) from the file's header, without decoding the pixels."""
    with _open(path, key) as image:
        return image.size


def read_gray(path: str | Path, expected_size: tuple[int, int] | None = None, key: str = "image") -> np.ndarray:
    """Reads a gray image as stored, uint8 or uint16 [height, width]. A colour image with equal channels counts as gray.
    Raises CaptureError if its (width, height) is not expected_size."""
    mode, pixels = _pixels(path, key, expected_size, (*_GRAY_MODES, *_COLOR_MODES), "8-bit or 16-bit gray")
    if mode in _COLOR_MODES:
        if not (pixels == pixels[..., :1]).all():
            raise CaptureError(f"{path}: {key}: is a colour image, expected 8-bit or 16-bit gray, or equal channels")
        return np.ascontiguousarray(pixels[..., 0])
    if pixels.dtype == np.uint8:
        return pixels
    if pixels.size and not 0 <= pixels.min() <= pixels.max() <= 65535:
        raise CaptureError(f"{path}: {key}: has values from {pixels.min()} to {pixels.max()}, 16 bits hold 0 to 65535")
    return pixels.astype(np.uint16)


def block_means(image: np.ndarray, size: int) -> np.ndarray:
    """Averages an image over blocks of size x size pixels, float32. Rows and columns that fill no block are dropped."""
    height, width = (length // size for length in image.shape)
    blocks = image[: height * size, : width * size].reshape(height, size, width, size)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float32))


def block_numbers(shape: tuple[int, ...], size: int) -> np.ndarray:
    """Returns the number of each pixel's block of size x size pixels, [height, width], counted row by row."""
    rows, columns = (np.arange(length) // size for length in shape)
    return np.asarray(rows[:, None] * (columns[-1] + 1) + columns)


def read_color(path: str | Path, expected_size: tuple[int, int] | None = None, key: str = "image") -> np.ndarray:
    """Reads a colour image as stored, uint8 [height, width, 3]; a gray image gets three equal channels. Raises
    CaptureError if its (width, height) is not expected_size."""
    _, pixels = _pixels(path, key, expected_size, (*_COLOR_MODES, "L"), "8-bit colour")
    return pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2)


def read_npy(path: str | Path, key: str, *axes: str) -> np.ndarray:
    """Reads a .npy array, uint8 or uint16. axes: names of the axes that it must have, such as "height"."""
    try:
        # Mapped, so that a header that promises more than the file holds is an error before memory is taken.
        counts = np.load(checked_file(path), mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, OverflowError, EOFError) as error:
        raise CaptureError(f"{path}: {key}: cannot be read as a .npy array: {error}") from error
    if counts.ndim != len(axes) or not counts.size or counts.dtype not in (np.uint8, np.uint16):
        expected = "".join(f"[{axis}]" for axis in axes)
        raise CaptureError(f"{path}: {key}: is {counts.dtype} {counts.shape}, expected uint8 or uint16 {expected}")
    return np.array(counts)


def write_gray(path: str | Path, pixels: np.ndarray) -> None:
    """Writes uint8 or uint16 pixels [height, width] as a gray PNG."""
    if pixels.dtype not in (np.uint8, np.uint16) or pixels.ndim != 2:
        raise ValueError(f"{path}: expected uint8 or uint16 [height][width], got {pixels.dtype} {pixels.shape}")
    write_png(path, pixels)


def _open(path: str | Path, key: str) -> Image.Image:
    try:
        image = Image.open(checked_file(path))
    except UnidentifiedImageError as error:
        raise CaptureError(f"{path}: {key}: cannot be read as an image") from error
    except (*_DAMAGES, Image.DecompressionBombError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise CaptureError(f"{path}: {key}: cannot be read as an image: {reason}") from error
    if image.width * image.height > _MOST_PIXELS:
        raise CaptureError(f"{path}: {key}: is {image.width}x{image.height}, at most {_MOST_PIXELS} pixels are read")
    return image


def _pixels(
    path: str | Path, key: str, expected_size: tuple[int, int] | None, modes: tuple[str, ...], expected: str
) -> tuple[str, np.ndarray]:
    """Decodes an image and returns (Pillow mode, pixels). modes: the allowed Pillow modes; expected: words for them in
    errors. Pixels of colour modes are uint8 [height, width, 3]."""
    with _open(path, key) as image:
        if image.mode not in modes:
            raise CaptureError(f"{path}: {key}: is a {image.mode} image, expected {expected}")
        if expected_size is not None and image.size != expected_size:
            width, height = image.size
            raise CaptureError(f"{path}: {key}: is {width}x{height}, expected {expected_size[0]}x{expected_size[1]}")
        try:
            return image.mode, np.asarray(image.convert("RGB") if image.mode in _COLOR_MODES else image)
        except _DAMAGES as error:
            raise CaptureError(f"{path}: {key}: is damaged: {error}") from error
