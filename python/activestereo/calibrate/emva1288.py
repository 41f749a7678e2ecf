# SPDX-License-Identifier: Apache-2.0
"""Measures a camera by EMVA 1288, the standard of machine vision: photon transfer (photon_transfer.py), DSNU and PRNU,
as text and as a sensor model. The package emva1288 states the standard's own table of the same files.

DSNU and PRNU are the fixed pattern of all frames, as a model's terms. The standard (Release 4.0 Linear, sections 4 and
8) states variances of averaged frames, which include the lamp's unevenness, waves and defect pixels. The split here
removes these in turn,

    field     a polynomial of the fourth degree: lamp, lens and glow
    waves     sinusoids that stand out from the spectrum around them
    defects   pixels farther than five standard deviations from the others

and states the variances of columns, rows and pixels of the rest, less the temporal noise's."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from operator import mul
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import chi2

from activestereo.calibrate import photon_transfer
from activestereo.calibrate.noise import LEAST_REPEATS
from activestereo.calibrate.photon_transfer import DEVIATIONS, LARGEST_CLIPPED, PhotonTransfer, Recording, Step, step_of
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.common.text_table import columns
from activestereo.effects import builtin
from activestereo.model import Imager, Quantity, SensorModel
from activestereo.model.words import quantity_text

__all__ = ["Emva1288", "Recording", "Step", "calibrate_emva1288", "is_emva1288", "measure", "step_of"]

Array = NDArray[np.float64]

_DEGREE, _LEAST_SIDE = 4, 16
_DEFECT = 5.0
# A peak is a wave if noise alone would show it, anywhere in the spectrum, with less than this chance. Noise power is
# exponentially distributed.
_CHANCE, _MOST_WAVES, _BLOCK = 1e-4, 6, 16
# Waves with fewer cycles across the image belong to the field.
_SLOWEST = 8
_ROUNDS = 2
_MEDIAN_TO_SIGMA = 1.4826
_SOURCE = "EMVA 1288 nonuniformity"
_READING = 0.7  # share of the time
_FEWEST_HOT = 5


@dataclass(frozen=True)
class Wave:
    """A sinusoid in the image: amplitude sin(2 pi (u x + v y) + phase). u, v: cycles per pixel."""

    amplitude: Quantity
    u: float
    v: float


@dataclass(frozen=True)
class Split:
    """The parts into which split() separates an averaged image. mean: over all pixels but defects, without waves.
    pixel, column, row: standard deviations of the offsets of pixels, columns and rows. excess: each defect's difference
    from its surroundings."""

    mean: Quantity
    pixel: Quantity
    column: Quantity
    row: Quantity
    waves: tuple[Wave, ...]
    excess: Array


@dataclass(frozen=True)
class Nonuniformity:
    """The fixed pattern's figures. dark: split of the dark frames, DN. light: split of the light, as shares. field:
    lowest and highest light over the mean. pixels: number in a frame. photons, exposure_s: of the lit frames."""

    dark: Split
    light: Split
    field: tuple[float, float]
    pixels: int
    photons: float | None
    exposure_s: float


def nonuniformity(recording: Recording) -> Nonuniformity | None:
    """Computes the figures from a lit and a dark step of three or more frames each; None without them. Of several lit
    steps it takes the one nearest to half of the range. Raises ValueError if the counts clip or no dark step has its
    exposure."""
    stacks = [step for step in recording.steps if step.average is not None]
    lit, darks = [s for s in stacks if not s.is_dark], [s for s in stacks if s.is_dark]
    if not lit or not darks:
        return None
    bright = min(lit, key=lambda step: abs(step.mean_dn - 0.5 * recording.max_dn))
    dark = next((step for step in darks if step.exposure_s == bright.exposure_s), None)
    if dark is None:
        lacks = f"no {bright.frames} dark frames of its exposure time, {bright.exposure_s:g} s"
        raise ValueError(f"{bright.place}: {lacks}: cover the lens and record as many")
    if bright.clipped > LARGEST_CLIPPED:
        clipped = f"{100 * bright.clipped:.1f} % of the counts clip"
        raise ValueError(f"{bright.place}: {clipped}: record these frames at half of saturation")
    of_light, of_dark = bright.average, dark.average
    assert of_light is not None and of_dark is not None
    signal, size = bright.mean_dn - dark.mean_dn, of_light.shape
    if signal <= 0.0 or min(size) < _LEAST_SIDE:
        has = f"{size[1]}x{size[0]} pixels, {signal:+.2f} DN over the dark"
        needed = f"DSNU and PRNU need frames of {_LEAST_SIDE}x{_LEAST_SIDE} or more, and light"
        raise ValueError(f"{bright.place}: {has}: {needed}")
    noise = [step.variance_dn2 / step.frames for step in (bright, dark)]
    difference = of_light - of_dark
    field = _field(difference, np.ones(difference.shape, bool))
    light = split(difference / field, sum(noise) / signal**2, "1")
    # Ends of the field over its mean, each farther out by its error. Defects change the mean, not the light.
    degrees = np.arange(_DEGREE + 1)
    relative, ends = field / field.mean(), []
    for place, sign in ((int(np.argmin(relative)), -1.0), (int(np.argmax(relative)), 1.0)):
        at = 2.0 * np.array(np.unravel_index(place, field.shape)) / (np.array(field.shape) - 1.0) - 1.0
        down, across = np.polynomial.legendre.legvander(at, _DEGREE) ** 2 * (2.0 * degrees + 1.0)
        terms = np.outer(down, across)[np.add.outer(degrees, degrees) <= _DEGREE]
        error = light.pixel.value * float(np.sqrt(terms.sum() / field.size))
        end = float(relative.flat[place]) + sign * DEVIATIONS * error
        ends.append(end / (1.0 + light.excess.sum() / bright.pixels))
    dark_split = split(of_dark, noise[1], "DN")
    return Nonuniformity(dark_split, light, (ends[0], ends[1]), bright.pixels, bright.photons, bright.exposure_s)


def split(image: Array, noise: float, unit: str) -> Split:
    """Splits an averaged image [height, width] into mean, waves, defects and the spreads of columns, rows and pixels,
    in the image's unit. noise: variance that temporal noise leaves in a pixel."""
    m, n = image.shape
    good, waves, drawn = np.ones(image.shape, bool), [], np.zeros(image.shape)
    for _ in range(_ROUNDS):  # each part is found better without the others
        field = _field(image - drawn, good)
        pixels = _without_lines(image - drawn - field, good)
        sigma = _MEDIAN_TO_SIGMA * float(np.median(np.abs(pixels - np.median(pixels))))
        good = np.abs(pixels) <= _DEFECT * max(sigma, 1e-12)
        waves = _waves(np.where(good, image - field, 0.0), unit)
        drawn = sum((part for _, part in waves), np.zeros(image.shape))
    field = _field(image - drawn, good)
    rest = image - drawn - field
    pixels = _without_lines(rest, good)
    degrees = int(good.sum()) - m - n + 1
    variance = float((pixels[good] ** 2).sum() / degrees)
    taken = 1 + _DEGREE  # the field's share of the lines' freedom
    of_columns, of_rows = (
        float((np.where(good, rest, 0.0).sum(axis=axis) / np.maximum(good.sum(axis=axis), 1)).var(ddof=taken))
        for axis in (0, 1)
    )
    column = _deviation(of_columns, n - taken, variance / m, unit)
    row = _deviation(of_rows, m - taken, variance / n, unit)
    level = float((image - drawn)[good].mean())
    half = DEVIATIONS * float(np.sqrt(variance / (m * n) + column.value**2 / n + row.value**2 / m))
    return Split(
        Quantity(level, level - half, level + half, unit, _SOURCE),
        _deviation(variance, degrees, noise, unit), column, row,
        tuple(wave for wave, _ in waves), pixels[~good],
    )  # fmt: skip


def _deviation(variance: float, degrees: int, noise: float, unit: str) -> Quantity:
    """Computes the standard deviation sqrt(variance - noise) with its 90 % interval. degrees: the variance's degrees of
    freedom. If the variance is below the noise, the interval reaches at least the square root of that deficit."""
    low, high = (variance * degrees / chi2.ppf(p, degrees) - noise for p in (0.95, 0.05))
    value, low, high = (float(np.sqrt(max(v, 0.0))) for v in (variance - noise, low, max(high, noise - variance)))
    return Quantity(value, low, high, unit, _SOURCE)


def _field(image: Array, good: NDArray[np.bool_]) -> Array:
    """Fits a polynomial of x and y to the good pixels by least squares and returns its image."""
    down, across = (np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, size), _DEGREE) for size in image.shape)
    beyond = np.add.outer(np.arange(_DEGREE + 1), np.arange(_DEGREE + 1)) > _DEGREE
    field = np.full(image.shape, image[good].mean())
    for _ in range(2):  # other pixels take the fit's own value
        weights = np.linalg.pinv(down) @ np.where(good, image, field) @ np.linalg.pinv(across).T
        weights[beyond] = 0.0
        field = down @ weights @ across.T
    return np.asarray(field)


def _without_lines(rest: Array, good: NDArray[np.bool_]) -> Array:
    """Subtracts from each pixel the means of its column and row, which are taken over good pixels."""
    for axis in (0, 1):
        count = np.maximum(good.sum(axis=axis, keepdims=True), 1)
        rest = rest - np.where(good, rest, 0.0).sum(axis=axis, keepdims=True) / count
    return rest


def _waves(image: Array, unit: str) -> list[tuple[Wave, Array]]:
    """Finds sinusoids in an image and returns each with its image, the most conspicuous peak of the spectrum first. It
    skips those along an axis, which count as rows and columns."""
    m, n = image.shape
    across = np.arange(n // 2 + 1) / n
    down = np.where(np.arange(m) <= m // 2, np.arange(m), np.arange(m) - m) / m
    lines = (np.abs(down * m)[:, None] < 2) | (across * n < 2)
    slow = (np.abs(down * m)[:, None] < _SLOWEST) & (across * n < _SLOWEST)
    rest = image - image.mean()
    found: list[tuple[Wave, Array]] = []
    while len(found) < _MOST_WAVES:
        power = np.where(lines | slow, 0.0, np.abs(np.fft.rfft2(rest)) ** 2 / rest.size)
        # The noise around each bin has a mean power by the median of its block; without any it is infinite.
        around = np.full(power.shape, np.inf)
        for top in range(0, power.shape[0], _BLOCK):
            for left in range(0, power.shape[1], _BLOCK):
                block = (slice(top, top + _BLOCK), slice(left, left + _BLOCK))
                if (inside := power[block][power[block] > 0.0]).size:
                    around[block] = np.median(inside) / np.log(2.0)
        ratio = power / around
        place = np.unravel_index(int(np.argmax(ratio)), power.shape)
        if ratio[place] < np.log(power.size / _CHANCE):
            break
        (u, v), part = _sinusoid(rest, across[place[1]], down[place[0]])
        rest = rest - part
        amplitude, half = float(np.sqrt(2.0) * part.std()), DEVIATIONS * float(np.sqrt(2.0 * rest.var() / rest.size))
        quantity = Quantity(amplitude, max(amplitude - half, 0.0), amplitude + half, unit, _SOURCE)
        found.append((Wave(quantity, u, v), part))
    return found


def _sinusoid(image: Array, u: float, v: float) -> tuple[tuple[float, float], Array]:
    """Refines the frequencies (u, v), in cycles per pixel, by least squares. Returns ((u, v), image of the sinusoid
    that fits best)."""
    m, n = image.shape

    def turns(f: Array) -> tuple[Array, Array]:
        return np.exp(2j * np.pi * f[1] * np.arange(m)), np.exp(2j * np.pi * f[0] * np.arange(n))

    def power(f: Array) -> float:
        down, across = turns(f)
        return float(-abs(down @ (image @ across.real) + 1j * (down @ (image @ across.imag))))

    simplex = np.array([[u, v], [u + 0.3 / n, v], [u, v + 0.3 / m]])
    best = minimize(
        power, simplex[0], method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-3 / max(m, n), "fatol": 0.0, "maxiter": 80},
    ).x  # fmt: skip
    down, across = turns(best)
    turn = np.outer(down, across).ravel()
    # At half a cycle per pixel the sine vanishes: a weight on it would be noise.
    weights = np.linalg.lstsq(np.stack([turn.real, turn.imag], axis=1), image.ravel(), rcond=1e-2)[0]
    return (float(best[0]), float(best[1])), (turn.real * weights[0] + turn.imag * weights[1]).reshape(m, n)


@dataclass(frozen=True)
class Emva1288:
    """A camera's EMVA 1288 figures; quantities have 90 % intervals and are None if unknown. spatial: None if no lit and
    dark step has three or more frames. responsivity: R in DN per photon, for light anywhere in the image. prnu:
    relative standard deviation of the pixels' own sensitivities. black: dark mean in DN without dark current; from
    averaged frames also without waves and defects. dark_current: DN/s if it differs from 0, without the hot pixels'
    part. hot_pixels: parameters of that effect; empty without hot pixels."""

    transfer: PhotonTransfer
    spatial: Nonuniformity | None
    responsivity: Quantity | None
    prnu: Quantity | None
    black: Quantity
    dark_current: Quantity | None
    hot_pixels: dict[str, Quantity]

    def model(self) -> SensorModel:
        """Makes a SensorModel of the imager, black level and effects, for model.json. summary() names the effects that
        it cannot hold."""
        noise = self.transfer.dark_noise
        offset = _map(noise, lambda sigma: sigma**2 + ROUNDING_VARIANCE, "DN^2")
        imager = Imager(offset, self.transfer.gain, Quantity(0.0, unit="1"))
        model = SensorModel(imager=imager, nuisances={"black_dn": self.black})
        for name, parameters in self._effects():
            if not _beyond(name, parameters):
                model = model.with_effect(builtin()[name], parameters)
        return model

    def summary(self) -> str:
        """Describes the figures as text, which the command prints: name, value with its 90 % interval, and its place in
        model.json."""
        t = self.transfer
        rows: list[tuple[str, Quantity | str, str]] = [
            ("system gain K", replace(t.gain, unit="DN/e-"), "imager.shot"),
            ("dark noise, unrounded", t.dark_noise, "imager.offset"),
            ("dark noise", _ratio(t.dark_noise, t.gain, "e-"), ""),
            ("dark signal", self.black, "nuisances.black_dn"),
        ]
        if self.responsivity is not None:
            rows.append(("responsivity R", replace(self.responsivity, unit="DN/p"), ""))
            rows.append(("quantum efficiency eta", _ratio(self.responsivity, t.gain, "%", 100.0), ""))
        limit = "" if t.is_saturated else " or more: no step is saturated"
        rows.append(("saturation", f"{t.saturation_dn:.4g} DN{limit}", ""))
        if t.dark_current is not None:
            rows.append(("dark current", t.dark_current, "dark_signal" if self.dark_current else ""))
        if self.spatial is not None and self.prnu is not None:
            dark, light = self.spatial.dark, self.spatial.light
            for part in ("column", "row", "pixel"):
                rows.append((f"DSNU {part}s", getattr(dark, part), f"fixed_pattern_noise.{part}_dn"))
            for part, share in (("columns", light.column), ("rows", light.row), ("pixels", self.prnu)):
                rows.append((f"PRNU {part}", _map(share, partial(mul, 100.0), "%"), "prnu" if part == "pixels" else ""))
            lowest, highest = self.spatial.field
            rows.append(("light across the image", f"{100 * lowest:.4g} to {100 * highest:.4g} %", ""))
            for where, found, scale, unit in (("dark", dark, 1.0, "DN"), ("light", light, 100.0, "%")):
                for wave in found.waves:
                    amplitude = quantity_text(_map(wave.amplitude, partial(mul, scale), unit))
                    place = f"at {wave.u:.4f}, {wave.v:.4f} cycles/px"
                    rows.append((f"wave in the {where}", f"{amplitude} {place}", ""))
                if len(found.excess):
                    mean = f"{scale * float(found.excess.mean()):+.3g} {unit} in the mean"
                    place = "hot_pixels" if where == "dark" and self.hot_pixels else ""
                    rows.append((f"defect pixels in the {where}", f"{len(found.excess)} beyond 5 sigma, {mean}", place))
        # Then the figures that model.json cannot hold, with the reason.
        lines = [
            f"EMVA 1288: {t.steps} steps of light, {t.used_steps} of them below 70 % of saturation",
            columns([(name, q if isinstance(q, str) else quantity_text(q), place) for name, q, place in rows]),
        ]
        for name, parameters in self._effects():
            if beyond := _beyond(name, parameters):
                lines.append(f"not in model.json: {name}, for {beyond}")
        if t.response is not None and len(t.response.coefficients) > 1:
            why = "no power law (response_gamma) follows it from its origin on"
            lines.append(f"not in model.json: the bent response, for {why}")
        if self.spatial is None:
            lines.append("DSNU, PRNU and defects: record 3 or more frames, better 100, of one lit and one dark step")
        elif self.spatial.dark.waves or self.spatial.light.waves:
            lines.append("not in model.json: waves, and columns and rows of PRNU, for which there is no effect")
        return "\n".join(lines)

    def _effects(self) -> Iterator[tuple[str, dict[str, Quantity]]]:
        if self.dark_current is not None:
            yield "dark_signal", {"rate_dn_per_s": self.dark_current}
        if self.spatial is None or self.prnu is None:
            return
        dark = self.spatial.dark
        yield "prnu", {"sigma": self.prnu}
        yield "fixed_pattern_noise", {"column_dn": dark.column, "row_dn": dark.row, "pixel_dn": dark.pixel}
        if self.hot_pixels:
            yield "hot_pixels", self.hot_pixels


def calibrate_emva1288(
    frames: Path, dark: Path | None = None, tell: Callable[[float], object] = lambda fraction: None
) -> Emva1288:
    """Measures a camera from recorded frames. frames: the standard's descriptor file, which lists dark frames, too, or
    a folder with one subfolder for each step of light; `dark` is then a folder of dark frames. Raises ValueError with
    file, number and remedy."""
    if frames.is_dir():
        if dark is None:
            raise ValueError(f"{frames}: steps of light need dark frames: cover the lens, record two, and give --dark")
        recording = photon_transfer.read_folders(frames, dark)
    elif dark is not None:
        raise ValueError(f"{frames}: lists its own dark frames after lines 'd': leave --dark out")
    else:
        recording = photon_transfer.read_descriptor(frames, lambda fraction: tell(_READING * fraction))
    return measure(recording)


def measure(recording: Recording) -> Emva1288:
    """Computes the figures of a recording in memory. Raises ValueError as calibrate_emva1288() does."""
    transfer, spatial = photon_transfer.photon_transfer(recording), nonuniformity(recording)
    current = transfer.dark_current
    if current is not None and current.low is not None and current.low <= 0.0:
        current = None
    if spatial is None:
        return Emva1288(transfer, None, transfer.responsivity, None, transfer.black, current, {})
    hot = _hot_pixels(spatial)
    if current is not None and hot:
        shift = -hot["share"].value * hot["rate_dn_per_s"].value
        current = _map(current, lambda rate: rate + shift, current.unit)
    responsivity = transfer.responsivity
    if responsivity is not None and responsivity.low is not None and responsivity.high is not None:
        # Photons are stated for one place of an uneven field: the interval holds all of it.
        lowest, highest = spatial.field
        responsivity = replace(responsivity, low=responsivity.low * lowest, high=responsivity.high * highest)
    # A bent response shows less of a pixel's own sensitivity.
    response, photons = transfer.response, spatial.photons
    bend = 1.0 if response is None or photons is None else response.bend(photons)
    prnu = _map(spatial.light.pixel, lambda share: share * (1.0 / bend), "1")
    # The averaged dark frame's mean, less the dark current's part in its exposure.
    black = spatial.dark.mean
    if current is not None and black.high is not None and current.high is not None:
        value = black.value - current.value * spatial.exposure_s
        half = float(np.hypot(black.high - black.value, (current.high - current.value) * spatial.exposure_s))
        black = replace(black, value=value, low=value - half, high=value + half)
    return Emva1288(transfer, spatial, responsivity, prnu, black, current, hot)


def is_emva1288(frames: Path) -> bool:
    """Returns whether a path is an EMVA 1288 recording: a descriptor file, or a folder whose subfolders have two to
    nine frames each."""
    if frames.is_dir() and not (frames / "capture.json").exists():
        counts = [sum(1 for _ in folder.glob("*.png")) for folder in frames.iterdir() if folder.is_dir()]
        return bool(counts) and max(counts) > 1 and min(counts) < LEAST_REPEATS
    return frames.is_file() and frames.suffix != ".npy" and frames.name != "capture.json"


def _hot_pixels(spatial: Nonuniformity) -> dict[str, Quantity]:
    """Estimates the exponential distribution of the hot pixels' rates. The defects show only its upper part; weaker hot
    pixels are hidden in the other pixels' spread."""
    excess = spatial.dark.excess[spatial.dark.excess > 0.0]
    if len(excess) < _FEWEST_HOT or spatial.exposure_s <= 0.0:
        return {}
    n, least = len(excess), float(excess.min())
    tail = max(float(excess.mean() - least) * n / (n - 1), 1e-6)
    rate = tail / spatial.exposure_s
    low, high = (2.0 * n * rate / float(chi2.ppf(p, 2 * n)) for p in (0.95, 0.05))
    share = n / spatial.pixels * float(np.exp(least / tail))
    spread = float(np.exp(DEVIATIONS * np.hypot(1.0, least / tail) / np.sqrt(n)))
    source = spatial.dark.pixel.source
    return {
        "share": Quantity(share, share / spread, share * spread, "1", source),
        "rate_dn_per_s": Quantity(rate, low, high, "DN/s", source),
    }


def _beyond(name: str, parameters: dict[str, Quantity]) -> str:
    """Describes the first parameter that exceeds the effect's limit; an empty text if none does."""
    limits = {p.name: p for p in builtin()[name].parameters}
    for key, q in parameters.items():
        if not limits[key].low <= q.value <= limits[key].high:
            return f"{key} {q.value:.4g} {q.unit} is beyond its {limits[key].high:g}"
    return ""


def _map(q: Quantity, function: Callable[[float], float], unit: str) -> Quantity:
    """Applies a rising function to a quantity's value and to the ends of its interval."""
    low, high = (None if end is None else function(end) for end in (q.low, q.high))
    return Quantity(function(q.value), low, high, unit, q.source)


def _ratio(q: Quantity, divisor: Quantity, unit: str, factor: float = 1.0) -> Quantity:
    """Computes factor * q / divisor with its interval, for independent errors."""
    value = factor * q.value / divisor.value
    if q.value == 0.0 or None in (q.low, q.high, divisor.low, divisor.high):
        return Quantity(value, unit=unit, source=q.source)
    low, high = (
        value * (1.0 + sign * float(np.hypot(end / q.value - 1.0, other / divisor.value - 1.0)))
        for sign, end, other in ((-1.0, q.low, divisor.high), (1.0, q.high, divisor.low))
        if end is not None and other is not None
    )
    return Quantity(value, low, high, unit, q.source)
