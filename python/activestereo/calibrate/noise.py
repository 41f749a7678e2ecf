# SPDX-License-Identifier: Apache-2.0
"""Reads frames of static views, and measures the imager's temporal noise from their repeats: chooses a noise model and
fits its parameters. Static speckle, fixed patterns and a pixel's own gain are the same in every repeat: they never show
here."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from activestereo.calibrate import noise_fit
from activestereo.calibrate.noise_fit import NOISE_MODELS, Counts, NoiseFit
from activestereo.capture.capture import SIDES, read_capture
from activestereo.capture.images import read_gray
from activestereo.common.input_files import checked_file
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.model import Imager, Quantity, SensorModel

LEAST_REPEATS = 10
_LARGEST_DRIFT, _LARGEST_EXCESS = 0.005, 2.0


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
            kind = f"{counts.dtype} {list(counts.shape)}"
            raise ValueError(f"{path}: is {kind}, expected uint8 or uint16 [frame][height][width]")
        views = [Repeats(path.name, np.array(counts), None, path.name)]
    elif path.name == "capture.json" or (path / "capture.json").is_file():
        views = _read_capture(path)
    elif path.is_dir():
        views = []
        for folder in [path, *sorted(child for child in path.iterdir() if child.is_dir())]:
            files = sorted(folder.glob("*.png"))
            images = [read_gray(file, key="image") for file in files]
            kinds = [f"{image.shape[1]}x{image.shape[0]} {image.dtype}" for image in images]
            for file, kind in zip(files, kinds, strict=True):
                if kind != kinds[0]:
                    raise ValueError(f"{file}: is {kind}, {files[0].name} is {kinds[0]}")
            if images:
                views.append(Repeats(str(folder), np.stack(images), None, str(folder)))
    else:
        raise ValueError(f"{path}: is no folder, no .npy stack and no capture")
    if not views:
        raise ValueError(f"{path}: holds no PNG files: give a folder of frames of one static view, or of such folders")
    for view in views:
        if len(view.counts) < least:
            told = f"{len(view.counts)} repeats, at least {least} are needed"
            raise ValueError(f"{view.name}: {told}: record more frames of the same static view")
    return views


def _read_capture(path: Path) -> list[Repeats]:
    capture = read_capture(path)
    views = []
    for group, frames in capture.repeats().items():
        for side in SIDES:
            name = f"{capture.path}: repeat group {group}, {side}"
            if len({frame.exposure_gain for frame in frames}) > 1:
                told = "exposure x gain differs between the repeats: give each exposure a group of its own"
                raise ValueError(f"{name}: {told}")
            counts = np.stack([read_gray(frame.path(side), key=f"frames[id={frame.id}].{side}") for frame in frames])
            view = f"{side} {frames[0].camera_to_world.tobytes()!r} {frames[0].projector_power}"
            views.append(Repeats(name, counts, frames[0].exposure_gain, view))
    if not views:
        told = f"no frames share a repeat_group: record {LEAST_REPEATS} or more frames of each static view"
        raise ValueError(f"{capture.path}: {told}")
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


# Number of counts to use, enough for half a percent of k; with more repeats, fewer pixels are used.
_COUNTS, _FEWEST_PIXELS, _MOST_PIXELS = 150_000, 1500, 4000
_LARGEST_DARK = 200_000
_LARGEST_CLIPPED = 0.5
_NOTE = "Static speckle and fixed patterns are the same in every repeat: they never show in repeats."


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
        source = f"calibrate noise: {self.chosen} noise model, {self.pixels} pixels, {self.repeats} repeats"
        source += "; static speckle does not show in repeats"
        sigma, zero = fit.interval("sigma_dn"), Quantity(0.0, unit="1")
        value, low, high = (v**2 + ROUNDING_VARIANCE for v in (noise_model.sigma_dn, *sigma))
        offset = Quantity(value, low, high, unit="DN^2", source=source)
        if self.chosen == "gamma":
            value, high, low = (1.0 / shape for shape in (noise_model.shape, *fit.interval("shape")))
            imager = Imager(offset, replace(zero, unit="DN"), Quantity(value, low, high, "1", source))
        else:
            imager = Imager(offset, Quantity(noise_model.shape, *fit.interval("shape"), "DN", source), zero)
        source = f"calibrate noise: from {self.black_from}"
        black = Quantity(noise_model.black_dn, *fit.interval("black_dn"), "DN", source)
        return SensorModel(imager=imager, nuisances={"black_dn": black})

    def summary(self) -> str:
        """Describes the noise as text, which the command prints."""
        noise_model, fit = self.fit.noise_model, self.fit
        margin, error = self.margin_nats
        other = next(kind.name for kind in NOISE_MODELS if kind.name != self.chosen)
        sure = "" if margin > 2.0 * error else "; the two are alike on this data: record brighter and darker views"
        by = f"by {margin:.3g} ± {error:.2g} nats per held-out pixel over {other}{sure}"
        lines = [f"noise model: {self.chosen}, {by}"]
        shape = ("k", "shape", "") if self.chosen == "gamma" else ("K", "shape", " DN/e-")
        for word, name, unit in (shape, ("sigma", "sigma_dn", " DN"), ("black", "black_dn", " DN")):
            low, high = fit.interval(name)
            lines.append(f"{word:6} {getattr(noise_model, name):.4g} ({low:.4g} to {high:.4g}){unit}")
        if self.chosen == "gamma":
            theta = f"{1.0 / noise_model.shape:.4g} = 1/k: a gauge, for the clean image is the frames' mean"
            lines.append(f"theta  {theta}")
        lines += [
            f"exposure x gain {p.exposure_gain:.4g} s: mean {p.mean_dn:.2f} DN, variance {p.variance_dn2:.3f} DN²"
            for p in self.transfer
        ]
        counted = f"{100 * self.clipped_share:.2f} % of the counts clipped, censored"
        lines.append(f"black from {self.black_from}; {counted}; {self.pixels} pixels, {self.repeats} repeats")
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
            means = f"its mean is {brightest:.2f} DN, the lit frames' {darkest:.2f}"
            raise ValueError(f"{darks[0].name}: {means}: give frames without any light to --dark")
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
    rest, judged = counts.part(np.flatnonzero(~held)), counts.part(np.flatnonzero(held))
    for place, kind in enumerate(NOISE_MODELS):
        half = noise_fit.fit_noise_model(kind, rest, None, black, with_error=False).noise_model
        dark_nats = noise_fit.dark_log_density(counts, half) / held.sum()
        halves[kind.name], density[kind.name] = half, noise_fit.log_density(judged, half) + dark_nats
        tell(0.05 + 0.25 * (place + 1))
    chosen = max(density, key=lambda name: float(density[name].sum()))
    noise_model = halves[chosen]
    fit = noise_fit.fit_noise_model(type(noise_model), counts, noise_model, black)
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
            clipped = f"{100.0 * (1.0 - len(usable) / flat.shape[1]):.0f} % of the pixels clip at 0 or {max_dn} DN"
            raise ValueError(f"{view.name}: {clipped}: change the exposure so that most lie between")
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
