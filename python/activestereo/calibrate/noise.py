# SPDX-License-Identifier: Apache-2.0
"""Measures the imager's temporal noise from repeats of static views: chooses a noise model and fits its parameters.

Repeats show changes from frame to frame. Static speckle, fixed patterns and a pixel's own gain are the same in every
repeat, so they never show here."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from activestereo.calibrate.frames import Repeats, bit_depth, check_still, read_repeats
from activestereo.calibrate.noise_fit import (
    NOISE_MODELS,
    Counts,
    NoiseFit,
    dark_log_density,
    fit_noise_model,
    log_density,
)
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.model import Imager, Quantity, SensorModel

# Number of counts to use, enough for half a percent of k; with more repeats, fewer pixels are used.
_COUNTS, _FEWEST_PIXELS, _MOST_PIXELS = 150_000, 1500, 4000
_LARGEST_DARK = 200_000
_LARGEST_CLIPPED = 0.5
_NOTE = (
    "Static speckle and fixed patterns are the same in every repeat: they never show in repeats, and are not part of "
    "this."
)


@dataclass(frozen=True)
class TransferPoint:
    """Repeats at one exposure (seconds x gain): mean and temporal variance of the pixels that do not clip."""

    exposure_gain: float
    mean_dn: float
    variance_dn2: float


@dataclass(frozen=True)
class Noise:
    """The measured noise. fit: the noise model under which held-out pixels are more probable. margin_nats: by how much,
    per held-out pixel, with its standard error. clipped_share: share of all counts that clip. black_from: source of the
    black level."""

    fit: NoiseFit
    margin_nats: tuple[float, float]
    pixels: int
    repeats: int
    clipped_share: float
    black_from: str
    transfer: tuple[TransferPoint, ...] = ()

    @property
    def chosen(self) -> str:
        """Name of the chosen noise model."""
        return self.fit.noise_model.name

    def model(self) -> SensorModel:
        """Makes a SensorModel of the imager, with the black level among its nuisances, for model.json. Rounding's
        variance is part of the offset."""
        noise_model, fit = self.fit.noise_model, self.fit
        source = (
            f"calibrate noise: {self.chosen} noise model, {self.pixels} pixels, {self.repeats} repeats; static speckle "
            "does not show in repeats"
        )
        sigma, zero = fit.interval("sigma_dn"), Quantity(0.0, unit="1")
        value, low, high = (v**2 + ROUNDING_VARIANCE for v in (noise_model.sigma_dn, *sigma))
        offset = Quantity(value, low, high, unit="DN^2", source=source)
        if self.chosen == "gamma":
            high, low = fit.interval("shape")
            imager = Imager(
                offset, replace(zero, unit="DN"), Quantity(1.0 / noise_model.shape, 1.0 / low, 1.0 / high, "1", source)
            )
        else:
            imager = Imager(offset, Quantity(noise_model.shape, *fit.interval("shape"), "DN", source), zero)
        black = Quantity(
            noise_model.black_dn, *fit.interval("black_dn"), "DN", f"calibrate noise: from {self.black_from}"
        )
        return SensorModel(imager=imager, nuisances={"black_dn": black})

    def summary(self) -> str:
        """Describes the noise as text, which the command prints."""
        noise_model, fit = self.fit.noise_model, self.fit
        margin, error = self.margin_nats
        other = next(kind.name for kind in NOISE_MODELS if kind.name != self.chosen)
        sure = "" if margin > 2.0 * error else "; the two are alike on this data: record brighter and darker views"
        lines = [
            f"noise model: {self.chosen}, by {margin:.3g} ± {error:.2g} nats per held-out pixel over {other}{sure}"
        ]
        rows = [
            ("k" if self.chosen == "gamma" else "K", "shape", "" if self.chosen == "gamma" else " DN/e-"),
            ("sigma", "sigma_dn", " DN"),
            ("black", "black_dn", " DN"),
        ]
        for word, name, unit in rows:
            low, high = fit.interval(name)
            lines.append(f"{word:6} {getattr(noise_model, name):.4g} ({low:.4g} to {high:.4g}){unit}")
        if self.chosen == "gamma":
            lines.append(
                f"theta  {1.0 / noise_model.shape:.4g} = 1/k: a gauge, for the clean image is the frames' mean"
            )
        lines += [
            f"exposure x gain {p.exposure_gain:.4g} s: mean {p.mean_dn:.2f} DN, variance {p.variance_dn2:.3f} DN²"
            for p in self.transfer
        ]
        lines.append(
            f"black from {self.black_from}; {100 * self.clipped_share:.2f} % of the counts clipped, censored; "
            f"{self.pixels} pixels, {self.repeats} repeats"
        )
        return "\n".join([*lines, _NOTE])


def calibrate_noise(
    frames: Path | list[Repeats], dark: Path | list[Repeats] | None = None, seed: int = 0,
    progress: Callable[[float], object] | None = None,
) -> Noise:  # fmt: skip
    """Measures the Noise of repeats, which are given or read from a path. dark: repeats without any light. seed:
    chooses the pixels that are used. Raises ValueError with file, number and remedy: fewer than 10 repeats, repeats
    that move, clipped views, dark frames that are not dark."""
    tell = progress or (lambda fraction: None)
    views = read_repeats(frames) if isinstance(frames, (str, Path)) else frames
    darks = [] if dark is None else read_repeats(dark, least=2) if isinstance(dark, (str, Path)) else dark
    for view in views:
        check_still(view)
    max_dn = 2 ** bit_depth([*views, *darks]) - 1
    rng = np.random.default_rng(seed)
    pixels = _chosen_pixels(views, max_dn, rng)
    dark_counts = []  # [pixel][repeat] of each dark view, pixels at random
    if darks:
        brightest, darkest = max(float(d.counts.mean()) for d in darks), min(float(v.counts.mean()) for v in views)
        if brightest >= darkest:
            raise ValueError(
                f"{darks[0].name}: its mean is {brightest:.2f} DN, the lit frames' {darkest:.2f}: give frames without "
                "any light to --dark"
            )
        flat = [view.counts.reshape(len(view.counts), -1) for view in darks]
        most = _LARGEST_DARK // sum(len(own) for own in flat)
        for own in flat:
            some = own if own.shape[1] <= most else own[:, rng.choice(own.shape[1], most, replace=False)]
            dark_counts.append(some.T)
    counts = Counts.from_pixels(pixels, dark_counts, max_dn)
    transfer = []
    known = sorted((v for v in views if v.exposure_gain is not None), key=lambda view: view.exposure_gain or 0.0)
    if len({view.exposure_gain for view in known}) > 1:
        for view in known:
            values = view.counts.astype(np.float64)
            clear = ((values > 0) & (values < max_dn)).all(axis=0)
            mean, variance = values.mean(axis=0)[clear], values.var(axis=0, ddof=1)[clear]
            transfer.append(TransferPoint(view.exposure_gain or 0.0, float(mean.mean()), float(variance.mean())))
    black = None if dark_counts else _black_of_exposures(views, max_dn)
    held = rng.random(len(counts.means)) < 0.5
    halves, density = {}, {}
    for place, kind in enumerate(NOISE_MODELS):
        halves[kind.name] = fit_noise_model(kind, counts.part(np.flatnonzero(~held)), None, black, with_error=False)
        density[kind.name] = log_density(counts.part(np.flatnonzero(held)), halves[kind.name].noise_model)
        density[kind.name] += dark_log_density(counts, halves[kind.name].noise_model) / held.sum()
        tell(0.05 + 0.25 * (place + 1))
    chosen = max(density, key=lambda name: float(density[name].sum()))
    noise_model = halves[chosen].noise_model
    fit = fit_noise_model(type(noise_model), counts, noise_model, black)
    difference = density[chosen] - density[next(name for name in density if name != chosen)]
    margin = float(difference.mean()), float(difference.std(ddof=1) / np.sqrt(len(difference)))
    every = [view.counts for view in views]
    return Noise(
        fit, margin, len(counts.means), int(max(len(view.counts) for view in views)),
        float(np.mean([np.mean((c == 0) | (c == max_dn)) for c in every])),
        "dark frames" if darks else "the exposures' intercept" if black is not None else "the views' darkest pixels",
        tuple(transfer),
    )  # fmt: skip


def _chosen_pixels(views: list[Repeats], max_dn: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Picks pixels of each view, spread evenly over the logarithm of their mean count. Returns their counts [pixel,
    repeat], one array for each view. Pixels that mostly clip are left out."""
    wanted = int(np.clip(_COUNTS / max(len(view.counts) for view in views), _FEWEST_PIXELS, _MOST_PIXELS))
    out = []
    for view in views:
        flat = view.counts.reshape(len(view.counts), -1)
        level = flat.mean(axis=0)
        middle = np.median(flat, axis=0)
        usable = np.flatnonzero((middle > 0) & (middle < max_dn))
        if len(usable) < _LARGEST_CLIPPED * flat.shape[1]:
            clipped = 1.0 - len(usable) / flat.shape[1]
            raise ValueError(
                f"{view.name}: {100 * clipped:.0f} % of the pixels clip at 0 or {max_dn} DN: change the exposure so "
                "that most lie between"
            )
        group = np.floor(4.0 * np.log2(level[usable] - level[usable].min() + 2.0)).astype(int)
        weight = 1.0 / np.bincount(group)[group]
        number = min(-(-wanted // len(views)), len(usable))
        out.append(flat[:, rng.choice(usable, number, replace=False, p=weight / weight.sum())].T)
    return out


def _black_of_exposures(views: list[Repeats], max_dn: int) -> float | None:
    """Extrapolates the mean of a view's unclipped pixels to exposure 0 by a line. None if no view has several
    exposures."""
    of: dict[str, list[Repeats]] = {}
    for view in views:
        if view.exposure_gain is not None:
            of.setdefault(view.view, []).append(view)
    blacks = []
    for same in of.values():
        times = np.array([view.exposure_gain for view in same])
        if len(np.unique(times)) < 2:
            continue
        means = np.stack([view.counts.mean(axis=0).ravel() for view in same])
        clear = np.all([((v.counts > 0) & (v.counts < max_dn)).all(axis=0).ravel() for v in same], axis=0)
        if clear.sum() > 100:
            blacks.append(float(np.polyfit(times, means[:, clear].mean(axis=1), 1)[1]))
    return float(np.median(blacks)) if blacks else None
