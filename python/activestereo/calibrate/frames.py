# SPDX-License-Identifier: Apache-2.0
"""Reads frames of static views: folders of PNG files, a folder of such folders, a .npy stack, or a capture's
repeats."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from activestereo.capture.capture import SIDES, read_capture
from activestereo.capture.images import read_gray
from activestereo.common.input_files import checked_file
from activestereo.common.rounding import ROUNDING_VARIANCE

LEAST_REPEATS = 10


@dataclass(frozen=True)
class Repeats:
    """Exposures of one static view. counts: [n, height, width], uint8 or uint16. exposure_gain: seconds x gain, None if
    unknown. view: names the scene and pose; repeats of one view at several exposures share it."""

    name: str
    counts: np.ndarray
    exposure_gain: float | None = None
    view: str = ""


def read_repeats(path: Path, least: int = LEAST_REPEATS) -> list[Repeats]:
    """Reads every static view under `path`. Raises ValueError if there is none, if one has fewer than `least` frames,
    or if sizes differ."""
    path = Path(path)
    if path.suffix == ".npy":
        try:
            # Mapped, so that a header that promises more than the file holds is an error before memory is taken.
            counts = np.load(checked_file(path), mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError, OverflowError, EOFError) as error:
            raise ValueError(f"{path}: cannot be read as a .npy stack: {error}") from error
        if counts.ndim != 3 or counts.dtype not in (np.uint8, np.uint16):
            raise ValueError(
                f"{path}: is {counts.dtype} {list(counts.shape)}, expected uint8 or uint16 [frame][height][width]"
            )
        views = [Repeats(path.name, np.array(counts), None, path.name)]
    elif path.name == "capture.json" or (path / "capture.json").is_file():
        views = _read_capture(path)
    elif path.is_dir():
        views = []
        for folder in [path, *sorted(child for child in path.iterdir() if child.is_dir())]:
            files = sorted(folder.glob("*.png"))
            images = [read_gray(file, key="image") for file in files]
            for file, image in zip(files, images, strict=True):
                if image.shape != images[0].shape or image.dtype != images[0].dtype:
                    raise ValueError(
                        f"{file}: is {image.shape[1]}x{image.shape[0]} {image.dtype}, {files[0].name} is "
                        f"{images[0].shape[1]}x{images[0].shape[0]} {images[0].dtype}"
                    )
            if images:
                views.append(Repeats(str(folder), np.stack(images), None, str(folder)))
    else:
        raise ValueError(f"{path}: is no folder, no .npy stack and no capture")
    if not views:
        raise ValueError(f"{path}: holds no PNG files: give a folder of frames of one static view, or of such folders")
    for view in views:
        if len(view.counts) < least:
            raise ValueError(
                f"{view.name}: {len(view.counts)} repeats, at least {least} are needed: record more frames of the same "
                "static view"
            )
    return views


def _read_capture(path: Path) -> list[Repeats]:
    capture = read_capture(path)
    views = []
    for group, frames in capture.repeats().items():
        for side in SIDES:
            name = f"{capture.path}: repeat group {group}, {side}"
            if len({frame.exposure_gain for frame in frames}) > 1:
                raise ValueError(
                    f"{name}: exposure x gain differs between the repeats: give each exposure a group of its own"
                )
            counts = np.stack([read_gray(frame.path(side), key=f"frames[id={frame.id}].{side}") for frame in frames])
            views.append(
                Repeats(
                    name,
                    counts,
                    frames[0].exposure_gain,
                    f"{side} {frames[0].camera_to_world.tobytes()!r} {frames[0].projector_power}",
                )
            )
    if not views:
        raise ValueError(
            f"{capture.path}: no frames share a repeat_group: record {LEAST_REPEATS} or more frames of each static view"
        )
    return views


def bit_depth(views: list[Repeats]) -> int:
    """Returns the bit depth of the views' counts: 8, or as many bits as the largest count in 16-bit files needs."""
    if all(view.counts.dtype == np.uint8 for view in views):
        return 8
    return max(8, max(int(view.counts.max()) for view in views).bit_length())


def check_still(view: Repeats) -> None:
    """Raises ValueError if the repeats' content moves or their brightness drifts."""
    counts = view.counts.astype(np.float32)
    half = len(counts) // 2
    first, second = counts[:half].mean(axis=0), counts[half:].mean(axis=0)
    # Take the noise from consecutive frames, so that a slow movement does not count as noise.
    variance = 0.5 * np.mean((counts[1:] - counts[:-1]) ** 2, axis=0) + ROUNDING_VARIANCE
    scale = variance * (1.0 / half + 1.0 / (len(counts) - half))
    means = counts.mean(axis=(1, 2))
    error = np.sqrt(variance.mean() / variance.size)
    drift = abs(float(second.mean() - first.mean()))
    if drift > max(_LARGEST_DRIFT * float(means.mean()), 6.0 * error):
        raise ValueError(
            f"{view.name}: the mean brightness drifts by {drift:.2f} DN of {means.mean():.1f}: hold exposure, gain and "
            "light, and let the camera warm up"
        )
    excess = float(np.mean((second - first) ** 2 / scale))
    if excess > _LARGEST_EXCESS:
        raise ValueError(
            f"{view.name}: the repeats move: their halves differ by {excess:.1f} times what noise gives: keep camera "
            "and scene still and record again"
        )


_LARGEST_DRIFT = 0.005
_LARGEST_EXCESS = 2.0
