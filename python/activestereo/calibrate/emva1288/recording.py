# SPDX-License-Identifier: Apache-2.0
"""Reads an EMVA 1288 measurement frame by frame, from its descriptor file or from folders, and keeps means and
variances.

The descriptor has the format of the standard's public reference sets; its paths are relative to it:

    v 3.0                      the standard's release
    n BITS WIDTH HEIGHT
    b EXPOSURE_NS PHOTONS      frames of even light follow
    d EXPOSURE_NS              dark frames follow
    i IMAGE

Two frames of each step give the temporal noise; more frames of one lit and one dark step give the fixed pattern
(Release 3.1, 6.5 and 8.1; Release 4.0 Linear has the same)."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.frames import bit_depth, read_repeats
from activestereo.capture.images import read_gray
from activestereo.common.input_files import read_text

# Largest share of a step's counts that may clip; more would bias its mean and narrow its noise.
LARGEST_CLIPPED = 0.005
_NS = 1e-9
# Frames of one step may differ in their mean by this share, or by this many counts in the dark.
_LARGEST_DRIFT, _LARGEST_DRIFT_DN = 0.02, 0.5
_HEADS = {"v": 1, "n": 3, "b": 2, "d": 1, "i": 1}


@dataclass(frozen=True)
class Step:
    """Frames of one exposure time under one even light. photons: per pixel, 0 in the dark, None if unknown.
    variance_dn2: temporal variance, averaged over all pixels. clipped: share of the counts at an end of the range.
    average: mean frame [height, width]; None of fewer than three frames."""

    place: str
    exposure_s: float
    photons: float | None
    frames: int
    pixels: int
    mean_dn: float
    variance_dn2: float
    clipped: float
    average: NDArray[np.float64] | None = None

    @property
    def is_dark(self) -> bool:
        """Whether the frames were taken without light."""
        return self.photons == 0.0


@dataclass(frozen=True)
class Recording:
    """An EMVA 1288 measurement; its steps are in the file's order."""

    name: str
    bit_depth: int
    steps: tuple[Step, ...]

    @property
    def max_dn(self) -> int:
        """The largest possible count."""
        return int(2**self.bit_depth - 1)


def step_of(
    frames: Iterable[NDArray[np.generic]], max_dn: int, exposure_s: float, photons: float | None, place: str
) -> Step:
    """Makes a Step from its frames, counts [height, width], which are read one by one. Raises ValueError for fewer than
    two, or if their means differ because the lamp drifts."""
    total = squares = np.zeros(1)
    means, clipped = [], 0.0
    for frame in frames:
        counts = np.asarray(frame, dtype=np.float64)
        total, squares = total + counts, squares + counts**2
        clipped += float(np.mean((counts <= 0) | (counts >= max_dn)))
        means.append(float(counts.mean()))
    n = len(means)
    if n < 2:
        raise ValueError(
            f"{place}: has {n} frame{'s'[: n != 1]}: record two of each step, 100 of one lit and one dark step"
        )
    average = total / n
    # A frame's mean is the lamp's or the offset's, not a pixel's noise (Release 4.0 Linear, 6.6).
    variance = float((squares / n - average**2).mean() * n / (n - 1) - np.var(means, ddof=1))
    drift = float(np.ptp(means))
    if drift > max(_LARGEST_DRIFT * float(np.mean(means)), _LARGEST_DRIFT_DN):
        raise ValueError(
            f"{place}: the frames' means differ by {drift:.2f} DN of {np.mean(means):.1f}: let lamp and camera warm up "
            "and record the frames of a step right after each other"
        )
    return Step(
        place, exposure_s, photons, n, average.size, float(np.mean(means)), variance, clipped / n,
        average if n > 2 else None,
    )  # fmt: skip


def read_descriptor(path: Path, progress: Callable[[float], object] | None = None) -> Recording:
    """Reads the measurement that a descriptor file lists. Raises ValueError with file, line and remedy."""
    tell = progress or (lambda fraction: None)
    bits = size = None
    heads: list[tuple[str, float, float]] = []
    files: list[list[Path]] = []
    for number, line in enumerate(read_text(path, errors="replace").splitlines(), 1):
        words, place = line.split(), f"{path}:{number}"
        if not words or words[0].startswith("#"):
            continue
        head, values = words[0], words[1:]
        if head == "i" and values:
            values = [line.split(maxsplit=1)[1].strip()]
        if _HEADS.get(head) != len(values):
            raise ValueError(
                f"{place}: is {line.strip()[:60]!r}, expected a line 'v', 'n', 'b', 'd' or 'i' of EMVA 1288"
            )
        if head == "n":
            bits, *size = (int(_number(value, place)) for value in values)
            if not 8 <= bits <= 16:
                raise ValueError(f"{place}: has {bits} bits, 8 to 16 can be read")
        elif head in "bd":
            photons = _number(values[1], place) if head == "b" else 0.0
            if head == "b" and photons == 0.0:
                raise ValueError(f"{place}: has 0 photons: dark frames stand after 'd {values[0]}'")
            heads.append((place, _NS * _number(values[0], place), photons))
            files.append([])
        elif head == "i":
            if not files:
                raise ValueError(f"{place}: an image before any line 'b' or 'd'")
            files[-1].append(path.parent / values[0].replace("\\", "/"))
    if bits is None or size is None:
        raise ValueError(f"{path}: has no line 'n BITS WIDTH HEIGHT': is it a descriptor of EMVA 1288?")
    steps, max_dn = [], 2**bits - 1
    for done, ((place, exposure_s, photons), images) in enumerate(zip(heads, files, strict=True)):
        frames = (_frame(file, (size[0], size[1]), max_dn, place) for file in images)
        steps.append(step_of(frames, max_dn, exposure_s, photons, place))
        tell((done + 1) / len(heads))
    return Recording(str(path), bits, tuple(steps))


def read_folders(lit: Path, dark: Path) -> Recording:
    """Reads a measurement from a folder with one subfolder for each step of light, and a folder of dark frames.
    Exposures and photons stay unknown. Raises ValueError as read_repeats() does."""
    stacks = [(view, None) for view in read_repeats(lit, 2)] + [(view, 0.0) for view in read_repeats(dark, 2)]
    shapes = {view.counts.shape[1:]: view.name for view, _ in stacks}
    if len(shapes) > 1:
        (first, name), (other, other_name) = list(shapes.items())[:2]
        raise ValueError(
            f"{other_name}: is {other[1]}x{other[0]}, {name} is {first[1]}x{first[0]}: record all steps "
            "with one setting"
        )
    bits = bit_depth([view for view, _ in stacks])
    steps = [step_of(view.counts, 2**bits - 1, 0.0, photons, view.name) for view, photons in stacks]
    return Recording(str(lit), bits, tuple(steps))


def _frame(file: Path, size: tuple[int, int], max_dn: int, place: str) -> NDArray[np.generic]:
    try:
        counts = read_gray(file, size)
    except OSError as error:
        raise ValueError(f"{place}: {file}: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"{place}: {error}: record all steps with one setting") from error
    if counts.max() > max_dn:
        raise ValueError(f"{place}: {file} has counts of {counts.max()}, line 'n' states at most {max_dn}")
    return counts


def _number(text: str, place: str) -> float:
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        value = -1.0
    if not 0.0 <= value < np.inf:
        raise ValueError(f"{place}: {text[:40]!r} is no number of 0 or more")
    return value
