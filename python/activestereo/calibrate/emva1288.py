# SPDX-License-Identifier: Apache-2.0
"""Measures a camera's gain and dark noise by the photon transfer of EMVA 1288, the standard of machine vision (Release
3.1, section 6.6; Release 4.0 Linear has the same), from two or more frames of each step of even light and of the dark:

    temporal variance = sigma^2 + K mean + c mean^2 + d mean^3 + 1/12      DN^2; mean: above black

The standard's line has no c and d. A bent response needs them; K is then the gain of weak light. The dark lies on the
same line, for dark current is shot noise, too. The package emva1288 states the standard's whole table of the same
files."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from activestereo.calibrate.frames import LEAST_REPEATS, bit_depth, read_repeats
from activestereo.calibrate.least_squares import INTERVAL_90
from activestereo.capture.images import read_gray
from activestereo.common.input_files import read_text
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.common.text_table import columns
from activestereo.model import Imager, Quantity, SensorModel
from activestereo.model.words import quantity_text

_SOURCE = "EMVA 1288 photon transfer"
# Largest share of a step's counts that may clip; more would bias its mean and narrow its noise.
_LARGEST_CLIPPED = 0.005
# Frames of one step may differ in their mean by this share, or by this many counts in the dark.
_LARGEST_DRIFT, _LARGEST_DRIFT_DN = 0.02, 0.5
_LEAST_STEPS = 3
# The gain is fitted up to this share of saturation (6.6).
_GAIN_RANGE = 0.7
# Below this variance rounding hides the noise of the dark (6.6); above the other its share is 1/12 to 1 % of sigma^2.
_LEAST_DARK_VARIANCE, _ROUNDED_WELL = 0.24, 0.25 + ROUNDING_VARIANCE
# The line has its highest power only if that differs from 0 by this number of standard deviations.
_BENT = 3.0


@dataclass(frozen=True)
class Step:
    """Frames of one exposure time under one even light. variance_dn2: temporal, averaged over all pixels. clipped:
    share of the counts at an end of the range."""

    place: str
    exposure_s: float
    is_dark: bool
    frames: int
    pixels: int
    mean_dn: float
    variance_dn2: float
    clipped: float


@dataclass(frozen=True)
class PhotonTransfer:
    """A camera's figures for weak light, with 90 % intervals. gain: K, DN per electron. dark_noise: standard deviation
    in DN, without rounding. black: mean of the dark in DN, at no exposure where three exposures or more tell."""

    gain: Quantity
    dark_noise: Quantity
    black: Quantity
    steps: int
    used_steps: int

    def model(self) -> SensorModel:
        """Makes a SensorModel of the imager and the black level, for model.json."""
        noise = self.dark_noise
        low, high = (None if end is None else end**2 + ROUNDING_VARIANCE for end in (noise.low, noise.high))
        offset = Quantity(noise.value**2 + ROUNDING_VARIANCE, low, high, "DN^2", noise.source)
        imager = Imager(offset, self.gain, Quantity(0.0, unit="1"))
        return SensorModel(imager=imager, nuisances={"black_dn": self.black})

    def summary(self) -> str:
        """Describes the figures as text: name, value with its 90 % interval, and its place in model.json."""
        rows = [
            ("system gain K (DN/e-)", quantity_text(self.gain), "imager.shot"),
            ("dark noise, unrounded", quantity_text(self.dark_noise), "imager.offset"),
            ("dark signal", quantity_text(self.black), "nuisances.black_dn"),
        ]
        head = f"EMVA 1288: {self.steps} steps of light, {self.used_steps} of them below 70 % of saturation"
        return f"{head}\n{columns(rows)}"


def is_emva1288(frames: Path) -> bool:
    """Returns whether a path is an EMVA 1288 recording: a descriptor file, or a folder whose subfolders have two to
    nine frames each."""
    if frames.is_dir() and not (frames / "capture.json").exists():
        counts = [sum(1 for _ in folder.glob("*.png")) for folder in frames.iterdir() if folder.is_dir()]
        return bool(counts) and max(counts) > 1 and min(counts) < LEAST_REPEATS
    return frames.is_file() and frames.suffix != ".npy" and frames.name != "capture.json"


def calibrate_emva1288(
    frames: Path, dark: Path | None = None, progress: Callable[[float], object] | None = None
) -> PhotonTransfer:
    """Measures a camera from recorded frames. frames: the standard's descriptor file, which lists dark frames, too, or
    a folder with one subfolder for each step of light; `dark` is then a folder of dark frames. Raises ValueError with
    file, number and remedy."""
    if not frames.is_dir():
        if dark is not None:
            raise ValueError(f"{frames}: lists its own dark frames after lines 'd': leave --dark out")
        return photon_transfer(str(frames), _read_descriptor(frames, progress or (lambda fraction: None)))
    if dark is None:
        raise ValueError(f"{frames}: steps of light need dark frames: cover the lens, record two, and give --dark")
    stacks = [(view, False) for view in read_repeats(frames, 2)] + [(view, True) for view in read_repeats(dark, 2)]
    max_dn = 2 ** bit_depth([view for view, _ in stacks]) - 1
    steps = [step_of(view.counts, max_dn, 0.0, is_dark, view.name) for view, is_dark in stacks]
    return photon_transfer(str(frames), steps)


def step_of(frames: Iterable[NDArray[np.generic]], max_dn: int, exposure_s: float, is_dark: bool, place: str) -> Step:
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
        raise ValueError(f"{place}: has {n} frame{'s'[: n != 1]}: record two of each step")
    # A frame's mean is the lamp's or the offset's, not a pixel's noise (Release 4.0 Linear, 6.6).
    variance = float((squares / n - (total / n) ** 2).mean() * n / (n - 1) - np.var(means, ddof=1))
    mean, drift = float(np.mean(means)), float(np.ptp(means))
    if drift > max(_LARGEST_DRIFT * mean, _LARGEST_DRIFT_DN):
        raise ValueError(
            f"{place}: the frames' means differ by {drift:.2f} DN of {mean:.1f}: let lamp and camera warm up "
            "and record the frames of a step right after each other"
        )
    return Step(place, exposure_s, is_dark, n, total.size, mean, variance, clipped / n)


def photon_transfer(name: str, steps: list[Step]) -> PhotonTransfer:
    """Computes the figures of steps of light and dark. name: the recording's, for messages. Raises ValueError, with a
    remedy, if dark frames or steps of light are missing, saturated, or without noise."""
    darks = [step for step in steps if step.is_dark]
    if not darks:
        raise ValueError(f"{name}: no dark frames: cover the lens and record two at each exposure time")
    for step in darks:
        if step.clipped > _LARGEST_CLIPPED:
            raise ValueError(f"{step.place}: {100 * step.clipped:.1f} % of the dark counts clip: raise the black level")
    # 1. Means and variances [step], with deviations for Gaussian noise. Counts that all agree are not exact: a variance
    # counts at least as rounding's.
    order = sorted(steps, key=lambda step: step.mean_dn)
    is_dark = np.array([step.is_dark for step in order])
    frames, pixels = np.array([(step.frames, step.pixels) for step in order]).T
    mean, variance = np.array([(step.mean_dn, step.variance_dn2) for step in order]).T
    least = np.maximum(variance, ROUNDING_VARIANCE)
    variance_error, mean_error = least * np.sqrt(2.0 / (pixels * (frames - 1))), np.sqrt(least / (frames * pixels))
    # 2. The black level: a line over the exposures of the dark, or their mean.
    exposures = np.array([step.exposure_s for step in order])[is_dark]
    degree = int(len(set(exposures)) >= _LEAST_STEPS)
    black, black_half = (ends[-1] for ends in _fit(exposures, mean[is_dark], mean_error[is_dark], degree))
    signal = mean - black
    # 3. Saturation: the last step whose variance is the largest within its error (2.4).
    peak = int(np.argmax(variance))
    top = np.flatnonzero(variance >= variance[peak] - 2.0 * np.hypot(variance_error, variance_error[peak]))[-1]
    clear = np.array([step.clipped for step in order]) <= _LARGEST_CLIPPED
    lit = ~is_dark & clear & (signal <= _GAIN_RANGE * signal[top])
    if lit.sum() < _LEAST_STEPS:
        raise ValueError(
            f"{name}: {lit.sum()} of {np.sum(~is_dark)} steps of light lie below 70 % of saturation without clipped "
            f"counts: the gain needs {_LEAST_STEPS}, better 50 from dark to saturation"
        )
    used = lit & (variance >= _ROUNDED_WELL)
    if used.sum() < _LEAST_STEPS:
        raise ValueError(
            f"{name}: {used.sum()} steps of light have half a count of noise: rounding hides the rest; use a higher "
            "gain or more bits"
        )
    # 4. The gain, and the dark noise, which lit steps tell where rounding hides it in the dark.
    is_hidden = np.average(variance[is_dark], weights=(pixels * frames)[is_dark]) < _LEAST_DARK_VARIANCE
    used |= is_dark & (not is_hidden)
    points = signal[used], variance[used] - ROUNDING_VARIANCE, variance_error[used]
    for degree in (3, 2, 1):
        values, halves = _fit(*points, min(degree, used.sum() - 2))
        if abs(values[0]) > _BENT * halves[0] / INTERVAL_90:
            break
    k, half, square, square_half = values[-2], halves[-2], values[-1], halves[-1]
    if k <= half:
        raise ValueError(f"{name}: the noise does not rise with the light: record steps from dark to saturation")
    sigma, low, high = np.sqrt(np.maximum([square, square - square_half, square + square_half], 0.0)).tolist()
    source = _SOURCE
    if is_hidden:
        most = float(np.sqrt(_LEAST_DARK_VARIANCE - ROUNDING_VARIANCE))
        sigma, low, high, source = min(sigma, most), 0.0, most, f"{_SOURCE}; rounding hides it in the dark"
    return PhotonTransfer(
        Quantity(float(k), float(k - half), float(k + half), "DN", _SOURCE),
        Quantity(sigma, low, high, "DN", source),
        Quantity(float(black), float(black - black_half), float(black + black_half), "DN", _SOURCE),
        int(np.sum(~is_dark)),
        int(lit.sum()),
    )


def _fit(x: np.ndarray, y: np.ndarray, error: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Fits a polynomial to values y [n] with standard deviations `error`, which grow where the residuals show more.
    Returns its coefficients, the highest power first, and half the width of their 90 % intervals."""
    degrees = len(x) - degree - 1
    design = np.vander(x, degree + 1) / error[:, None]
    size = np.linalg.norm(design, axis=0)  # columns of one size keep the inverse well conditioned
    inverse = np.linalg.pinv(design / size)
    found = inverse @ (y / error)
    scatter = float(np.sum((y / error - design / size @ found) ** 2)) / max(degrees, 1)
    half = np.sqrt(np.diag(inverse @ inverse.T)) / size
    if scatter > 1.0:
        return found / size, half * float(np.sqrt(scatter) * t.ppf(0.95, degrees))
    return found / size, half * INTERVAL_90


def _read_descriptor(path: Path, tell: Callable[[float], object]) -> list[Step]:
    """Reads the measurement that a descriptor file lists, in the format of the standard's public reference sets, with
    paths relative to it: v RELEASE; n BITS WIDTH HEIGHT; b EXPOSURE_NS PHOTONS, frames of even light follow; d
    EXPOSURE_NS, dark frames follow; i IMAGE. Raises ValueError with file, line and remedy."""
    form: list[int] = []
    steps: list[tuple[str, float, bool, list[Path]]] = []
    for number, line in enumerate(read_text(path, errors="replace").splitlines(), 1):
        head, _, rest = line.strip().partition(" ")
        place, rest = f"{path}:{number}", rest.strip()
        if not head or head.startswith("#"):
            continue
        if head == "i" and rest and not steps:
            raise ValueError(f"{place}: an image before any line 'b' or 'd'")
        if head == "i" and rest:
            steps[-1][3].append(path.parent / rest.replace("\\", "/"))
            continue
        try:
            values = [float(word.replace(",", ".")) for word in rest.split()]
        except ValueError:
            values = []
        if {"v": 1, "n": 3, "b": 2, "d": 1}.get(head) != len(values) or not all(0.0 <= v < np.inf for v in values):
            expected = "expected a line 'v', 'n', 'b', 'd' or 'i' of EMVA 1288 with numbers of 0 or more"
            raise ValueError(f"{place}: is {line.strip()[:60]!r}, {expected}")
        if head == "n":
            form = [int(value) for value in values]
            if not 8 <= form[0] <= 16:
                raise ValueError(f"{place}: has {form[0]} bits, 8 to 16 can be read")
        elif head in "bd":
            if values[-1] == 0.0 and head == "b":
                raise ValueError(f"{place}: has 0 photons: dark frames stand after 'd {rest.split()[0]}'")
            steps.append((place, 1e-9 * values[0], head == "d", []))
    if not form:
        raise ValueError(f"{path}: has no line 'n BITS WIDTH HEIGHT': is it a descriptor of EMVA 1288?")
    bits, width, height = form
    out = []
    for done, (place, exposure_s, is_dark, files) in enumerate(steps, 1):
        counts = (_frame(file, (width, height), 2**bits - 1, place) for file in files)
        out.append(step_of(counts, 2**bits - 1, exposure_s, is_dark, place))
        tell(done / len(steps))
    return out


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
