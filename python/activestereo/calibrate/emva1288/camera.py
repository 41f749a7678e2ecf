# SPDX-License-Identifier: Apache-2.0
"""Combines a camera's EMVA 1288 figures, and states them in the standard's terms and in model.json's."""

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
        """Describes the figures as text, which the command prints."""
        lines = [*_transfer_lines(self), *_spatial_lines(self)]
        for name, parameters in self._effects():
            if beyond := _beyond(name, parameters):
                lines.append(f"not in model.json: {name}, for {beyond}")
        response = self.transfer.response
        if response is not None and len(response.coefficients) > 1:
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


def _line(name: str, standard: str, ours: str = "", place: str = "") -> str:
    return f"{name:31}{standard:26}{ours:38}{place}".rstrip()


def _transfer_lines(camera: Emva1288) -> Iterator[str]:
    t = camera.transfer
    k, eta = t.gain_1288, None if t.responsivity_1288 is None else t.responsivity_1288 / t.gain_1288
    yield f"EMVA 1288 Release 4.0 Linear: {t.steps} steps of light, {t.used_steps} of them below 70 % of saturation"
    yield _line("", "the standard's", "at the response's origin (90 %)", "in model.json")
    yield _line("system gain K", f"{k:.5g} DN/e-", quantity_text(replace(t.gain, unit="DN/e-")), "imager.shot")
    yield _line(
        "dark noise sigma_y.dark",
        f"{t.dark_noise_1288_dn:.4g} DN",
        f"{quantity_text(t.dark_noise)} unrounded",
        "imager.offset",
    )
    sigma_e = float(np.sqrt(t.dark_noise_1288_dn**2 - ROUNDING_VARIANCE)) / k
    yield _line("dark noise sigma_d", f"{sigma_e:.4g} e-", quantity_text(_ratio(t.dark_noise, t.gain, "e-")))
    yield _line("dark signal mu_y.dark", f"{t.black.value:.4g} DN", quantity_text(camera.black), "nuisances.black_dn")
    r = camera.responsivity
    if r is not None and eta is not None and t.linearity_1288 is not None and t.saturation_photons is not None:
        yield _line("responsivity R", f"{t.responsivity_1288:.5g} DN/p", quantity_text(replace(r, unit="DN/p")))
        yield _line("quantum efficiency eta", f"{100 * eta:.4g} %", quantity_text(_ratio(r, t.gain, "%", 100.0)))
        low, high = t.linearity_1288
        yield _line("linearity error LE", f"{100 * low:.3g} to {100 * high:.3g} %")
        full = eta * t.saturation_photons
        threshold = (t.dark_noise_1288_dn / k + 0.5) / eta
        limit = "" if t.is_saturated else " or more: no step is saturated"
        yield _line("saturation capacity mu_e.sat", f"{full:.5g} e-{limit}")
        yield _line("sensitivity threshold mu_p.min", f"{threshold:.4g} p")
        yield _line(
            "SNR_max, dynamic range DR",
            f"{10 * np.log10(full):.4g}, {20 * np.log10(t.saturation_photons / threshold):.4g} dB",
        )
    if t.dark_current is not None:
        yield _line(
            "dark current mu_I.mean",
            f"{t.dark_current.value / k:.4g} e-/s",
            quantity_text(t.dark_current),
            "dark_signal" if camera.dark_current else "",
        )


def _spatial_lines(camera: Emva1288) -> Iterator[str]:
    spatial, prnu = camera.spatial, camera.prnu
    if spatial is None or prnu is None:
        return
    names = ("", " columns", " rows", " pixels")
    dark, light = spatial.dark, spatial.light
    split = (None, dark.column, dark.row, dark.pixel)
    for name, value, ours in zip(names, spatial.dsnu_1288_dn, split, strict=True):
        electrons = f"{value / camera.transfer.gain_1288:.4g} e-" if np.isfinite(value) else "below noise"
        place = f"fixed_pattern_noise.{name.strip()[:-1]}_dn" if ours else ""
        yield _line(f"DSNU{name}", electrons, quantity_text(ours) if ours else "", place)
    percent = [None if q is None else _map(q, lambda v: 100.0 * v, "%") for q in (None, light.column, light.row, prnu)]
    for name, value, part in zip(names, spatial.prnu_1288, percent, strict=True):
        share = f"{100 * value:.4g} %" if np.isfinite(value) else "below noise"
        yield _line(f"PRNU{name}", share, quantity_text(part) if part else "", "prnu" if name == " pixels" else "")
    lowest, highest = spatial.field
    yield _line("light across the image", f"{100 * lowest:.4g} to {100 * highest:.4g} %")
    for where, found, scale, unit in (("dark", dark, 1.0, "DN"), ("light", light, 100.0, "%")):
        for wave in found.waves:
            amplitude = quantity_text(_map(wave.amplitude, partial(mul, scale), unit))
            yield _line(f"wave in the {where}", f"{wave.u:.4f}, {wave.v:.4f} cycles/px", amplitude)
        if len(found.excess):
            mean = f"{scale * float(found.excess.mean()):+.3g} {unit} in the mean"
            place = "hot_pixels" if where == "dark" and camera.hot_pixels else ""
            yield _line(f"defect pixels in the {where}", f"{len(found.excess)} beyond 5 sigma", mean, place)
