# SPDX-License-Identifier: Apache-2.0
"""Reads frames of static views: repeats, dark frames and pairs at several light levels. Rejects views that move or
drift."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from activestereo.capture.capture import SIDES, read_capture
from activestereo.capture.images import read_gray, read_npy
from activestereo.common.input_files import read_text
from activestereo.common.own_files import own_file
from activestereo.common.rounding import ROUNDING_VARIANCE

LEAST_REPEATS = 10
_LARGEST_DRIFT, _LARGEST_EXCESS = 0.005, 2.0


@dataclass(frozen=True)
class Repeats:
    """Frames of one static view at one exposure. counts: [n, height, width], uint8 or uint16. exposure_gain: seconds x
    gain, None if unknown. view: identifies scene and pose; equal for repeats of one view at different exposures."""

    name: str
    counts: np.ndarray
    exposure_gain: float | None = None
    view: str = ""


def read_repeats(path: Path) -> list[Repeats]:
    """Reads every static view under `path`: a .npy stack, a capture, or a folder of PNG files or of such folders.
    Raises ValueError if there is none, if one has a single frame, or if image sizes differ."""
    if path.suffix == ".npy":
        views = [Repeats(path.name, read_npy(path, "stack", "frame", "height", "width"), None, path.name)]
    elif path.name == "capture.json" or (path / "capture.json").is_file():
        views = _read_capture(path)
    elif path.is_dir():
        views = []
        for folder in [path, *sorted(child for child in path.iterdir() if child.is_dir())]:
            if files := sorted(folder.glob("*.png")):
                views.append(Repeats(str(folder), _stacked(files, "image"), None, str(folder)))
    else:
        raise ValueError(f"{path}: is no folder, no .npy stack and no capture")
    if not views:
        raise ValueError(f"{path}: holds no PNG files: give a folder of frames of one static view, or of such folders")
    for view in views:
        if len(view.counts) < 2:
            raise ValueError(f"{view.name}: 1 frame: record two of each step of light, ten or more of a single view")
    return views


def _stacked(files: list[Path], key: str) -> np.ndarray:
    """Reads images of one size and type, [n, height, width]. key: as in read_gray()."""
    images = [read_gray(file, key=key) for file in files]
    kinds = [f"{image.shape[1]}x{image.shape[0]} {image.dtype}" for image in images]
    for file, kind in zip(files, kinds, strict=True):
        if kind != kinds[0]:
            raise ValueError(
                f"{file}: is {kind}, {files[0].name} is {kinds[0]}: give one stream alone, or import a capture"
            )
    return np.stack(images)


def _read_capture(path: Path) -> list[Repeats]:
    capture = read_capture(path)
    views = []
    for frames in capture.repeats():
        for side in SIDES:
            name = f"{capture.path}: repeat group {frames[0].repeat_group}, {side}"
            counts = np.stack([read_gray(frame.path(side), key=f"frames[id={frame.id}].{side}") for frame in frames])
            view = f"{side} {frames[0].camera_to_world.tobytes()!r} {frames[0].projector_power}"
            views.append(Repeats(name, counts, frames[0].exposure_gain, view))
    if not views:
        told = f"no frames share a repeat_group: record {LEAST_REPEATS} or more frames of each static view"
        raise ValueError(f"{capture.path}: {told}")
    return views


def read_steps(path: Path) -> tuple[list[Repeats], list[Repeats]]:
    """Returns (lit, dark): two frames of each light level, and of each dark exposure, from a descriptor file of EMVA
    1288. It has lines "b EXPOSURE PHOTONS" or "d EXPOSURE", each followed by its frames, "i IMAGE". Leaves out levels
    above 70 % of saturation (Release 4.0 Linear, 6.6). Raises ValueError with file, line and remedy."""
    steps: dict[str, list[tuple[str, list[Path]]]] = {"b": [], "d": []}
    lit: list[Repeats] = []
    dark: list[Repeats] = []
    files: list[Path] = []
    for number, line in enumerate(read_text(path, errors="replace").splitlines(), 1):
        head, _, rest = line.strip().partition(" ")
        if head in steps:
            files = []
            steps[head].append((f"{path}:{number}", files))
        elif head == "i":
            try:
                files.append(own_file(path.parent, rest.strip().replace("\\", "/")))
            except ValueError as error:
                raise ValueError(f"{path}:{number}: {error}") from error
        elif head[:1] not in ("v", "n", "#", ""):
            told = f"is {line[:60]!r}, expected a line 'v', 'n', 'b', 'd' or 'i' of EMVA 1288"
            raise ValueError(f"{path}:{number}: {told}")
    if not (steps["b"] and steps["d"]):
        raise ValueError(f"{path}: lists no steps of light, or no dark frames: cover the lens and record two")
    for head, views in (("b", lit), ("d", dark)):
        for name, own in steps[head]:
            if len(own) < 2:
                raise ValueError(f"{name}: has {len(own)} of two frames of each step")
            views.append(Repeats(name, _stacked(own[:2], name)))
    most = 0.7 * max(view.counts.mean() for view in lit)
    if not (lit := [view for view in lit if view.counts.mean() < most]):
        raise ValueError(
            f"{path}: no step of light lies below 70 % of the brightest, {most:.4g} DN: record darker ones"
        )
    return lit, dark


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
