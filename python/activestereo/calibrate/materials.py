# SPDX-License-Identifier: Apache-2.0
"""Measures an object's materials from a capture. A search over the whole range by successive halving (Jamieson and
Talwalkar 2016) comes first. Gauss-Newton steps then start at three candidates: the best, the best of another roughness,
and the scene's own values. Parameters that the pictures do not determine are reported, but not written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from activestereo.calibrate.least_squares import INTERVAL_90
from activestereo.calibrate.material_fit import COLORS, PARAMETERS, MaterialFit, MaterialScene, pictures, refine
from activestereo.capture.capture import read_capture
from activestereo.common.progress_bar import Progress, part_of, silent
from activestereo.effects.core.surfaces import surface_names, surfaces_of_object
from activestereo.model import Quantity, SensorModel
from activestereo.model.diagnosed import calibrated

_CANDIDATES, _KEEP = 32, 4  # a quarter of each round goes on, with four times the samples
_LEAST_KEPT = 4  # so that a candidate of another roughness is among the last ones
_SAMPLES = (4, 16, 64)
_FINE_SAMPLES = 32
_FIRST_REACH, _REACHES = 0.2, (0.15, 0.1)
_OTHER_ROUGHNESS = 0.2  # gloss has more than one minimum: sharp and weak looks like wide and strong
# If half an interval is wider than this, the pictures do not determine the value.
_UNDETERMINED = {
    "roughness": 0.25, "metallic": 0.4, "specular": 0.5, "transmission": 0.3, "ir_albedo": 0.25, "color": 0.25,
}  # fmt: skip
_METAL = 0.9


@dataclass(frozen=True)
class Materials:
    """The measured materials of an object. found: {surface: {parameter: Quantity}} of determined parameters.
    undetermined: {surface: names}. loss: Residuals.loss of the scene's own materials and of the found ones. renders:
    number of rendered candidates. pictures: names. colors: linear RGB of surfaces without a colour in the scene."""

    object_name: str
    found: dict[str, dict[str, Quantity]]
    undetermined: dict[str, tuple[str, ...]]
    loss: tuple[float, float]
    renders: int
    pictures: tuple[str, ...]
    colors: dict[str, list[float]]

    def model(self) -> SensorModel:
        """Makes a SensorModel of the determined parameters, for model.json."""
        return SensorModel(materials={name: fields for name, fields in self.found.items() if fields})

    def summary(self) -> str:
        """Describes the materials as text, which the command prints."""
        lines = [f"{self.object_name}, from {', '.join(self.pictures)}"]
        for surface, fields in self.found.items():
            lines.append(f"{surface}:")
            lines += [f"  {name:13}{q.value:.3f} ({q.low:.3f} to {q.high:.3f})" for name, q in fields.items()]
            if surface in self.colors:
                red, green, blue = self.colors[surface]
                lines.append(f"  colour as linear RGB {red:.2f} {green:.2f} {blue:.2f}, for the scene has none for it")
            if self.undetermined[surface]:
                lines.append(f"  not determined by these pictures: {', '.join(self.undetermined[surface])}")
        before, after = self.loss
        residuals = f"mean square of the residuals {after:.2f} (as the scene had it: {before:.2f})"
        lines.append(f"{residuals}; {self.renders} candidates rendered")
        return "\n".join(lines)


def calibrate_materials(
    path: Path, object_name: str, seed: int = 0, device: str = "auto", model: SensorModel | None = None,
    progress: Progress = silent,
) -> Materials:  # fmt: skip
    """Measures the materials of an object in the capture at `path`. model: a known rig and pattern in place of the
    capture's. Raises ValueError with the fault: no such object, a part without material, two surfaces of one name, out
    of view, no infrared image."""
    capture = read_capture(path)
    if model is not None:
        capture = calibrated(capture, model)
    surfaces = surfaces_of_object(capture.scene_path, object_name)
    names = surface_names(capture.scene_path)
    own = [names[number] for number in surfaces]
    if twins := sorted({name for name in own if own.count(name) > 1}):
        twice = f"more than one surface is called '{twins[0]}': give each a name of its own"
        raise ValueError(f"{capture.scene_path}: {twice}")
    scene = MaterialScene(capture, device)
    seen = pictures(scene, capture, surfaces)
    fit = MaterialFit(scene, seen, surfaces, seed)
    nominal = fit.start()
    ranked = _wide(fit, nominal, seed, part_of(progress, 0.0, 0.5))
    scenes_own = fit.with_colors(nominal, _FINE_SAMPLES)
    # The best candidate with another roughness than the first one's, or the second one if all have the same.
    rough = np.array([name == "roughness" for _, name in fit.parameters])
    apart = (theta for theta in ranked[1:] if np.abs(theta - ranked[0])[rough].max() > _OTHER_ROUGHNESS)
    starts = [ranked[0], next(apart, ranked[1]), scenes_own]
    firsts = [
        refine(fit, theta, (_FIRST_REACH,), _FINE_SAMPLES, part_of(progress, 0.5 + 0.1 * k, 0.6 + 0.1 * k))
        for k, theta in enumerate(starts)
    ]
    better = min(firsts, key=lambda refined: refined.residuals.loss).theta
    best = refine(fit, better, _REACHES, _FINE_SAMPLES, part_of(progress, 0.8, 1.0))
    before = fit.residuals(scenes_own, _FINE_SAMPLES).loss
    source = f"calibrate materials: {len(seen)} pictures of {capture.name}"
    # Separate the determined values from those that these pictures leave open.
    told = dict.fromkeys(names[number] for number, _ in fit.parameters)
    found: dict[str, dict[str, Quantity]] = {surface: {} for surface in told}
    open_: dict[str, list[str]] = {surface: [] for surface in told}
    colors: dict[str, list[float]] = {}
    for (number, name), value, error in zip(fit.parameters, best.theta, best.sigma, strict=True):
        half, surface = INTERVAL_90 * float(error), names[number]
        kind = "color" if name in COLORS else name
        if half > _UNDETERMINED[kind]:
            open_[surface].append(name)
        elif name in COLORS:
            colors.setdefault(surface, []).append(float(value))
        else:
            low, high = max(float(value) - half, 0.0), min(float(value) + half, 1.0)
            found[surface][name] = Quantity(float(value), low, high, "1", source)
    for surface, fields in found.items():
        # A metal lets no light through, whatever its transmission.
        if "transmission" in fields and "metallic" in fields and fields["metallic"].value > _METAL:
            del fields["transmission"]
            open_[surface].append("transmission")
        if any(name in COLORS for name in open_[surface]):
            colors.pop(surface, None)
            open_[surface] = [name for name in open_[surface] if name not in COLORS] + ["colour"]
    progress(1.0)
    undetermined = {surface: tuple(fields) for surface, fields in open_.items()}
    losses = before, best.residuals.loss
    return Materials(object_name, found, undetermined, losses, fit.renders, tuple(p.name for p in seen), colors)


def _wide(fit: MaterialFit, nominal: NDArray[np.float64], seed: int, progress: Progress) -> list[NDArray[np.float64]]:
    """Searches the whole range of the parameters by successive halving. nominal: the scene's own values, a candidate,
    too. Returns the last candidates, best first."""
    searched = [k for k, (_, name) in enumerate(fit.parameters) if name in PARAMETERS]
    unit = qmc.Sobol(len(searched), seed=seed).random(_CANDIDATES)
    # Few materials are between metal and not, or half clear.
    for column, k in zip(unit.T, searched, strict=True):
        if fit.parameters[k][1] in ("metallic", "transmission"):
            column[:] = np.clip(1.5 * (column - 0.6) / 0.4, 0.0, 1.0)
    spread = np.tile(nominal, (_CANDIDATES, 1))
    spread[:, searched] = fit.low[searched] + unit * (fit.high - fit.low)[searched]
    candidates = [nominal, *spread]
    total, done = sum(len(candidates) // _KEEP**k * s for k, s in enumerate(_SAMPLES)), 0
    for number, samples in enumerate(_SAMPLES):
        losses = []
        for k, candidate in enumerate(candidates):
            theta = candidates[k] = fit.with_colors(candidate, samples)
            losses.append(fit.residuals(theta, samples // 2).loss)
            done += samples
            progress(min(done / total, 1.0))
        order = np.argsort(losses)
        keep = len(candidates) if number == len(_SAMPLES) - 1 else max(_LEAST_KEPT, len(candidates) // _KEEP)
        candidates = [candidates[k] for k in order[:keep]]
    return candidates
