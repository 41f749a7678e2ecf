# SPDX-License-Identifier: Apache-2.0
"""Reads an EMVA 1288 measurement frame by frame, from its descriptor file or from folders, and measures photon
transfer: gain, temporal noise and linearity of a camera from pairs of evenly lit and of dark frames.

The descriptor has the format of the standard's public reference sets; its paths are relative to it:

    v 3.0                      the standard's release
    n BITS WIDTH HEIGHT
    b EXPOSURE_NS PHOTONS      frames of even light follow
    d EXPOSURE_NS              dark frames follow
    i IMAGE

Two frames of each step give the temporal noise; more frames of one lit and one dark step give the fixed pattern
(Release 3.1, 6.5 and 8.1; Release 4.0 Linear has the same).

Release 4.0 Linear (Release 3.1, sections 6.6 and 6.7) takes the gain K as the slope of variance over mean, which a
nonlinear response biases. Here the response is fitted as well if photons are known, and K is stated at its origin:

    mean = black + f(s)                          s = R photons, f(0) = 0, f'(0) = 1
    variance = (sigma^2 + K s) f'(s)^2 + 1/12    DN^2

A fit takes its values' known errors, and adds scatter if the residuals show more."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import norm, t

from activestereo.calibrate.noise import bit_depth, read_repeats
from activestereo.capture.images import read_gray
from activestereo.common.input_files import read_text
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.model import Quantity

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
        return self.photons == 0.0


@dataclass(frozen=True)
class Recording:
    """An EMVA 1288 measurement; its steps are in the file's order."""

    name: str
    bit_depth: int
    steps: tuple[Step, ...]

    @property
    def max_dn(self) -> int:
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
        told = f"has {n} frame{'s'[: n != 1]}: record two of each step, 100 of one lit and one dark step"
        raise ValueError(f"{place}: {told}")
    average = total / n
    # A frame's mean is the lamp's or the offset's, not a pixel's noise (Release 4.0 Linear, 6.6).
    variance = float((squares / n - average**2).mean() * n / (n - 1) - np.var(means, ddof=1))
    drift = float(np.ptp(means))
    if drift > max(_LARGEST_DRIFT * float(np.mean(means)), _LARGEST_DRIFT_DN):
        differ = f"the frames' means differ by {drift:.2f} DN of {np.mean(means):.1f}"
        remedy = "let lamp and camera warm up and record the frames of a step right after each other"
        raise ValueError(f"{place}: {differ}: {remedy}")
    mean, kept = float(np.mean(means)), average if n > 2 else None
    return Step(place, exposure_s, photons, n, average.size, mean, variance, clipped / n, kept)


def read_descriptor(path: Path, tell: Callable[[float], object]) -> Recording:
    """Reads the measurement that a descriptor file lists. Raises ValueError with file, line and remedy."""
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
            told = f"is {line.strip()[:60]!r}, expected a line 'v', 'n', 'b', 'd' or 'i' of EMVA 1288"
            raise ValueError(f"{place}: {told}")
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
        sizes = f"is {other[1]}x{other[0]}, {name} is {first[1]}x{first[0]}"
        raise ValueError(f"{other_name}: {sizes}: record all steps with one setting")
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


# Both tails of a 90 % interval, and half of its width in standard deviations.
_TAIL = 0.95
DEVIATIONS = float(norm.ppf(_TAIL))


@dataclass(frozen=True)
class WeightedFit:
    """The result of fit_weighted(). values: [k], with their covariance. quantile: half of a 90 % interval in standard
    deviations, Student's if the scatter was estimated. bic: Schwarz' criterion, lower is better."""

    values: np.ndarray
    covariance: np.ndarray
    quantile: float
    bic: float

    def error(self, place: int) -> float:
        return float(np.sqrt(max(self.covariance[place, place], 0.0)))

    def quantity(self, place: int, unit: str, source: str) -> Quantity:
        """Returns a value with its 90 % interval."""
        value, half = float(self.values[place]), self.quantile * self.error(place)
        return Quantity(value, value - half, value + half, unit, source)


def fit_weighted(columns: np.ndarray, values: np.ndarray, errors: np.ndarray, scale: Any = 1.0) -> WeightedFit:
    """Fits values [n] by columns [n, k] times k unknowns, weighted by known standard deviations `errors` [n]. Further
    scatter, proportional to `scale`, is added until chi square equals its expectation; it is 0 if chi square is
    lower."""
    degrees = len(values) - columns.shape[1]
    # Columns of one size keep the normal equations well conditioned.
    size = np.linalg.norm(columns, axis=0)

    def solve(scatter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        deviation = np.sqrt(errors**2 + (scatter * scale) ** 2)
        design = columns / size / deviation[:, None]
        inverse = np.linalg.pinv(design)
        found = inverse @ (values / deviation)
        return found, inverse @ inverse.T, values / deviation - design @ found, deviation

    def excess(scatter: float) -> float:
        rest = solve(scatter)[2]
        return float(rest @ rest) - degrees

    scatter = 0.0
    if degrees > 0 and excess(0.0) > 0.0:
        most = float(np.max(np.abs(values / scale)))
        scatter = float(brentq(excess, 0.0, most, xtol=1e-9 * most)) if excess(most) < 0.0 else most
    found, covariance, rest, deviation = solve(scatter)
    bic = float(2.0 * np.log(deviation).sum() + rest @ rest + columns.shape[1] * np.log(len(values)))
    quantile = float(t.ppf(_TAIL, degrees) if scatter > 0.0 else DEVIATIONS)
    return WeightedFit(found / size, covariance / np.outer(size, size), quantile, bic)


# Shares of saturation within which the gain (6.6) and the response (6.7) are fitted.
_GAIN_RANGE, _LINEAR_RANGE = 0.7, (0.05, 0.95)
# Below this variance rounding hides the noise of the dark (6.6); above the other its share is 1/12 to 1 % of sigma^2.
_LEAST_DARK_VARIANCE, _ROUNDED_WELL = 0.24, 0.25 + ROUNDING_VARIANCE

_LEAST_STEPS = 3
# A step may depart by this share from the response that fits all steps.
_LARGEST_DEPARTURE = 0.05
# Terms of the response; each further one must raise the evidence (BIC) by as much as is called strong.
_MOST_TERMS, _STRONG = 6, 10.0
_SOURCE = "EMVA 1288 photon transfer"


@dataclass(frozen=True)
class Response:
    """A polynomial response: the mean above black, in DN, of n photons is n (c_0 + c_1 x + c_2 x^2 ...), x = n /
    largest. s = c_0 n is the mean of a linear response with the same slope at the origin."""

    largest: float
    coefficients: np.ndarray

    def slope(self, photons: np.ndarray) -> np.ndarray:
        """Returns f'(s), the response's slope over its slope at the origin, at each number of photons."""
        curve = np.polynomial.Polynomial([0.0, *self.coefficients]).deriv()
        return np.asarray(curve(photons / self.largest) / self.coefficients[0])

    def bend(self, photons: float) -> float:
        """Returns f'(s) s / f(s): the relative change of the mean count over the relative change of the light, 1 if
        linear."""
        n = np.array([photons])
        mean = photons * np.polynomial.Polynomial(self.coefficients)(photons / self.largest)
        return float(self.slope(n)[0] * (self.coefficients[0] * n)[0] / mean)


@dataclass(frozen=True)
class PhotonTransfer:
    """The photon transfer's figures at the response's origin, with 90 % intervals. gain: K, DN per electron.
    dark_noise: without rounding. saturation_dn: mean above black. responsivity: R, DN per photon; it and the response
    are None if photons are unknown. dark_current: DN/s; None with fewer than three exposures."""

    gain: Quantity
    dark_noise: Quantity
    black: Quantity
    saturation_dn: float
    is_saturated: bool
    steps: int
    used_steps: int
    responsivity: Quantity | None
    response: Response | None
    dark_current: Quantity | None


@dataclass(frozen=True)
class _Levels:
    """Arrays [n] of the lit steps by rising light: photons, mean above the dark (DN), temporal variance (DN^2),
    standard errors of both, exposures."""

    photons: np.ndarray
    signal: np.ndarray
    variance: np.ndarray
    variance_error: np.ndarray
    mean_error: np.ndarray
    exposure_s: np.ndarray


def photon_transfer(recording: Recording) -> PhotonTransfer:
    """Computes the figures of a recording. Raises ValueError, with a remedy, if dark frames or steps of light are
    missing, saturated, or inconsistent."""
    # 1. Pairs of lit frames. Steps of more frames serve the nonuniformity; they give noise only if there are no pairs.
    dark = [step for step in recording.steps if step.is_dark]
    lit = [step for step in recording.steps if not step.is_dark]
    lit = [step for step in lit if step.average is None] or lit
    if len(lit) < _LEAST_STEPS:
        needed = f"the gain needs {_LEAST_STEPS} or more of two frames each, better 50 from dark to saturation"
        raise ValueError(f"{recording.name}: {len(lit)} step{'s'[: len(lit) != 1]} of light: {needed}")
    if not dark:
        raise ValueError(f"{recording.name}: no dark frames: cover the lens and record two at each exposure time")
    for step in dark:
        if step.clipped > LARGEST_CLIPPED:
            clipped = f"{100 * step.clipped:.1f} % of the dark counts clip"
            raise ValueError(f"{step.place}: {clipped}: raise the camera's black level")
    clear = sum(step.clipped <= LARGEST_CLIPPED for step in lit)
    if clear < _LEAST_STEPS:
        counts = f"{len(lit) - clear} of {len(lit)} steps of light have counts that clip at 0 or {recording.max_dn}"
        remedy = f"record {_LEAST_STEPS} or more with less light, or raise the black level"
        raise ValueError(f"{recording.name}: {counts}: {remedy}")
    # 2. Each step less the dark of its own exposure; several darks of one exposure count by their frames.
    means: dict[float, float] = {}
    for exposure in {step.exposure_s for step in dark}:
        same = [step for step in dark if step.exposure_s == exposure]
        means[exposure] = float(np.average([s.mean_dn for s in same], weights=[s.frames for s in same]))
    for step in lit:
        if step.exposure_s not in means:
            lacks = f"no dark frames of its exposure time, {step.exposure_s:g} s"
            raise ValueError(f"{step.place}: {lacks}: cover the lens and record two at each exposure time")
    photons = np.array([np.nan if step.photons is None else step.photons for step in lit])
    signal = np.array([step.mean_dn - means[step.exposure_s] for step in lit])
    order = np.argsort(photons if np.isfinite(photons).all() else signal, kind="stable")
    lit = [lit[place] for place in order]
    levels = _Levels(photons[order], signal[order], *_noise(lit), np.array([step.exposure_s for step in lit]))
    # Saturation: the last step whose variance is the largest within its error (2.4).
    peak = int(np.argmax(levels.variance))
    error = np.hypot(levels.variance_error, levels.variance_error[peak])
    top = int(np.flatnonzero(levels.variance >= levels.variance[peak] - 2.0 * error)[-1])
    used = (levels.signal <= _GAIN_RANGE * levels.signal[top]) & (np.arange(len(levels.signal)) <= top)
    if used.sum() < _LEAST_STEPS:
        below = f"{used.sum()} of {len(lit)} steps of light lie below {100 * _GAIN_RANGE:.0f} % of saturation"
        raise ValueError(f"{recording.name}: {below}: record ten or more from dark to saturation")
    # 3. The dark, at exposure 0.
    times = np.array([step.exposure_s for step in dark])
    several = len(set(times)) >= _LEAST_STEPS
    columns = np.stack([np.ones_like(times), times][: 1 + several], axis=1)
    variance, variance_error, mean_error = _noise(dark)
    dark_variance = fit_weighted(columns, variance, variance_error)
    black = fit_weighted(columns, np.array([d.mean_dn for d in dark]), mean_error)
    # 4. The response, where photons are known.
    response = _response(recording, levels, top) if np.isfinite(levels.photons).all() else None
    # 5. The gain.
    at_used = np.stack([np.ones(used.sum()), levels.exposure_s[used]][: 1 + several], axis=1)
    dark_at_used = at_used @ dark_variance.values
    gain, dark_noise = _gain(levels, used, dark_variance, dark_at_used, response)
    return PhotonTransfer(
        gain, dark_noise, black.quantity(0, "DN", _SOURCE), float(levels.signal[top]), top < len(levels.signal) - 1,
        len(lit), int(used.sum()), response[1].quantity(0, "DN", _SOURCE) if response else None,
        response[0] if response else None, black.quantity(1, "DN/s", _SOURCE) if several else None,
    )  # fmt: skip


def _noise(steps: Sequence[Step]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns three arrays [n]: the steps' temporal variances, the standard deviations of these for Gaussian noise, and
    those of the means. A variance counts at least as rounding's, because counts that all agree are not exact."""
    variance, frames, pixels = np.array([(step.variance_dn2, step.frames, step.pixels) for step in steps]).T
    least = np.maximum(variance, ROUNDING_VARIANCE)
    return variance, least * np.sqrt(2.0 / (pixels * (frames - 1))), np.sqrt(least / (frames * pixels))


def _response(recording: Recording, levels: _Levels, top: int) -> tuple[Response, WeightedFit]:
    """Fits the mean count over photons as a polynomial, between 5 and 95 % of saturation. The evidence (BIC) decides
    the number of terms. Returns (response, fit)."""
    low, high = (share * levels.signal[top] for share in _LINEAR_RANGE)
    inside = (levels.signal >= low) & (levels.signal <= high) & (np.arange(len(levels.signal)) <= top)
    if inside.sum() < _LEAST_STEPS:
        told = f"{inside.sum()} steps of light lie between 5 and 95 % of saturation: record ten or more"
        raise ValueError(f"{recording.name}: {told}")
    photons, signal = levels.photons[inside], levels.signal[inside]
    error = levels.mean_error[inside] / photons
    largest, ratio = float(photons.max()), signal / photons
    # An error of the dark or of the shutter is a constant: it rises over the signal towards no light.
    constant = largest / photons[:, None]
    chosen, columns, terms = None, constant, 0
    for count in range(1, min(_MOST_TERMS, inside.sum() - 2) + 1):
        powers = np.vander(photons / largest, count, increasing=True)
        for tried in (powers, np.hstack([powers, constant])):
            fit = fit_weighted(tried, ratio, error)
            if chosen is None or fit.bic < chosen.bic - _STRONG * (tried.shape[1] - columns.shape[1]):
                chosen, columns, terms = fit, tried, count
    assert chosen is not None
    response = Response(largest, chosen.values[:terms])
    expected = photons * (columns @ chosen.values)
    departure = signal / expected - 1.0
    worst = int(np.argmax(np.abs(departure)))
    if abs(departure[worst]) > _LARGEST_DEPARTURE:
        off = f"the step of {photons[worst]:g} photons is {100 * departure[worst]:+.1f} % off what the others tell"
        raise ValueError(f"{recording.name}: {off}: let the lamp warm up and measure its light with each step")
    return response, chosen


def _gain(
    levels: _Levels, used: np.ndarray, dark: WeightedFit, dark_at_used: np.ndarray,
    response: tuple[Response, WeightedFit] | None,
) -> tuple[Quantity, Quantity]:  # fmt: skip
    """Fits the temporal variance over the lit steps' signal. Returns (gain K in DN per electron, dark noise), both for
    a weak signal, at the response's origin. If rounding hides the dark frames' noise, lit steps give it."""
    hidden = dark.values[0] < _LEAST_DARK_VARIANCE
    variance, error = levels.variance[used], levels.variance_error[used]
    well = variance >= _ROUNDED_WELL
    if well.sum() < _LEAST_STEPS:
        told = f"{well.sum()} steps of light have half a count of noise: rounding hides the rest"
        raise ValueError(f"{told}; use a higher gain or more bits")

    def fitted(curve: Response | None) -> WeightedFit:
        if curve is None:
            linear, slope = levels.signal[used], np.ones(used.sum())
        else:
            linear, slope = curve.coefficients[0] * levels.photons[used], curve.slope(levels.photons[used])
        columns = np.stack([linear, np.ones_like(linear)][: 1 + hidden], axis=1) * slope[:, None] ** 2
        rest = variance - ROUNDING_VARIANCE - (0.0 if hidden else (dark_at_used - ROUNDING_VARIANCE) * slope**2)
        return fit_weighted(columns[well], rest[well], error[well], variance[well])

    fit = fitted(response[0] if response else None)
    error_of_k = fit.error(0)
    if response:
        # The gain where the response is one standard deviation off, in each independent direction.
        curve, terms = response[0], len(response[0].coefficients)
        squares, directions = np.linalg.eigh(response[1].covariance)
        nearby = response[1].values + (directions * np.sqrt(np.maximum(squares, 0.0))).T
        moved = [fitted(replace(curve, coefficients=near[:terms])).values[0] - fit.values[0] for near in nearby]
        error_of_k = float(np.hypot(error_of_k, np.linalg.norm(moved)))
    if not hidden:
        error_of_k = float(np.hypot(error_of_k, dark.error(0) / max(float(levels.signal[used].mean()), 1.0)))
    k, half = float(fit.values[0]), fit.quantile * error_of_k
    gain = Quantity(k, max(k - half, 0.0), k + half, "DN", _SOURCE)
    if not hidden:
        square, half = dark.values[0] - ROUNDING_VARIANCE, dark.quantile * dark.error(0)
        sigma, low, high = (float(np.sqrt(max(v, 0.0))) for v in (square, square - half, square + half))
        return gain, Quantity(sigma, low, high, "DN", _SOURCE)
    most = _LEAST_DARK_VARIANCE - ROUNDING_VARIANCE
    value = float(np.clip(fit.values[1], 0.0, most))
    source = f"{_SOURCE}; rounding hides it in the dark"
    return gain, Quantity(float(np.sqrt(value)), 0.0, float(np.sqrt(most)), "DN", source)
