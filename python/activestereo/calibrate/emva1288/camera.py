# SPDX-License-Identifier: Apache-2.0
"""Combines a camera's EMVA 1288 figures, and states them as text and as a sensor model."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from operator import mul
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from activestereo.calibrate.emva1288.nonuniformity import Nonuniformity, nonuniformity
from activestereo.calibrate.emva1288.recording import Recording, read_descriptor, read_folders
from activestereo.calibrate.emva1288.transfer import DEVIATIONS, PhotonTransfer, photon_transfer
from activestereo.calibrate.frames import LEAST_REPEATS
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.common.text_table import columns
from activestereo.effects import builtin
from activestereo.model import Imager, Quantity, SensorModel
from activestereo.model.words import quantity_text

_READING = 0.7  # share of the time
_FEWEST_HOT = 5


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
    frames: Path, dark: Path | None = None, progress: Callable[[float], object] | None = None
) -> Emva1288:
    """Measures a camera from recorded frames. frames: the standard's descriptor file, which lists dark frames, too, or
    a folder with one subfolder for each step of light; `dark` is then a folder of dark frames. Raises ValueError with
    file, number and remedy."""
    tell = progress or (lambda fraction: None)
    if frames.is_dir():
        if dark is None:
            raise ValueError(f"{frames}: steps of light need dark frames: cover the lens, record two, and give --dark")
        recording = read_folders(frames, dark)
    elif dark is not None:
        raise ValueError(f"{frames}: lists its own dark frames after lines 'd': leave --dark out")
    else:
        recording = read_descriptor(frames, lambda fraction: tell(_READING * fraction))
    return measure(recording)


def measure(recording: Recording) -> Emva1288:
    """Computes the figures of a recording in memory. Raises ValueError as calibrate_emva1288() does."""
    transfer, spatial = photon_transfer(recording), nonuniformity(recording)
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
