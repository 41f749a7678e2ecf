# SPDX-License-Identifier: Apache-2.0
"""An object's materials from a capture: a wide search by successive halving (Jamieson and Talwalkar 2016), then
Levenberg-Marquardt from the best two. What the pictures do not determine is named, and not written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from activestereo.acquire.material_fit import HIGH, LOW, PARAMETERS, MaterialFit, Residuals
from activestereo.acquire.material_views import MaterialScene, pictures
from activestereo.acquire.network_features import Network
from activestereo.capture import read_capture
from activestereo.progress_bar import part_of
from activestereo.scene_surfaces import surface_names, surfaces_of_object
from activestereo.sensor_model import Quantity, SensorModel
from activestereo.sensor_model.calibrated import calibrated

_CANDIDATES, _KEEP = 32, 4  # a quarter of each round goes on, with four times the samples
_SAMPLES = (4, 16, 64)
_FINE_STEPS, _STEP = 4, 0.08
_FINE_SAMPLES = 32
_INTERVAL_90 = 1.645
# Neighbouring pixels err alike, and the model errs beside the noise: so many residuals tell as much as one.
_ALIKE = 12.0
# Pixels and samples leave so much of any parameter open, by trials on balls of two paints.
_FLOOR = 0.012
# Half an interval wider than this says that the pictures do not determine the value.
_UNDETERMINED = {"roughness": 0.25, "metallic": 0.4, "specular": 0.5, "transmission": 0.3, "ir_albedo": 0.25}


@dataclass(frozen=True)
class Materials:
    """found: {surface: {parameter: Quantity}}, those that the pictures determine; undetermined: {surface: names}; loss:
    mean square in deviations, before and after; renders: how many candidates were rendered; colors:
    linear RGB of surfaces that the scene has no colour for."""

    object_name: str
    found: dict[str, dict[str, Quantity]]
    undetermined: dict[str, tuple[str, ...]]
    loss: tuple[float, float]
    renders: int
    pictures: tuple[str, ...]
    colors: dict[str, tuple[float, float, float]]

    def model(self) -> SensorModel:
        """model.json's section."""
        return SensorModel(materials={name: fields for name, fields in self.found.items() if fields})

    def text(self) -> str:
        """What a reader wants first."""
        lines = [f"{self.object_name}, from {', '.join(self.pictures)}"]
        for surface, fields in self.found.items():
            lines.append(f"{surface}:")
            lines += [f"  {name:13}{q.value:.3f} ({q.low:.3f} to {q.high:.3f})" for name, q in fields.items()]
            if surface in self.colors:
                red, green, blue = self.colors[surface]
                lines.append(
                    f"  seen as linear RGB {red:.2f} {green:.2f} {blue:.2f}, for the scene has no colour for it"
                )
            if self.undetermined[surface]:
                lines.append(f"  not determined by these pictures: {', '.join(self.undetermined[surface])}")
        before, after = self.loss
        lines.append(
            f"mean square of the residuals {after:.2f} (as the scene had it: {before:.2f}); {self.renders} candidates "
            "rendered"
        )
        return "\n".join(lines)


def acquire_materials(
    path: Path,
    object_name: str,
    seed: int = 0,
    full_grid: bool = False,
    device: str = "auto",
    model: SensorModel | None = None,
    network_path: Path | None = None,
    progress: Callable[[float], object] | None = None,
) -> Materials:
    """full_grid: all candidates of the wide search are rendered with the most samples. model: what is known of rig and
    pattern already, in place of the capture's. network_path: an ONNX file whose early layers compare pictures in place
    of the filter bank. ValueError names what is wrong: no such object, a part without material, out of view, no
    infrared image, no network."""
    network = None if network_path is None else Network(network_path)
    capture = read_capture(path)
    if model is not None:
        capture = calibrated(capture, model)
    surfaces = surfaces_of_object(capture.scene_path, object_name)
    scene = MaterialScene(capture, device)
    seen = pictures(scene, capture, surfaces)
    fit = MaterialFit(scene, seen, surfaces, seed, network)
    tell = progress or (lambda fraction: None)
    nominal = fit.start()
    colors = fit.estimate_colors(nominal, _FINE_SAMPLES)
    ranked = _wide(fit, nominal, seed, full_grid, part_of(tell, 0.0, 0.5))
    first = _fine(fit, ranked[0], part_of(tell, 0.5, 0.75))
    results = [first, _fine(fit, ranked[1], part_of(tell, 0.75, 1.0))]
    theta, residuals, sigma = min(results, key=lambda r: r[1].loss)
    before = fit.residuals(nominal, _FINE_SAMPLES).loss
    names = [surface_names(capture.scene_path)[k] for k in surfaces]
    source = f"acquire materials: {len(seen)} pictures of {capture.name}"
    found, undetermined = _judged(names, theta, sigma, source)
    tell(1.0)
    found_colors = {surface_names(capture.scene_path)[number]: color for number, color in colors.items()}
    losses = before, residuals.loss
    return Materials(object_name, found, undetermined, losses, fit.renders, tuple(p.name for p in seen), found_colors)


def _wide(
    fit: MaterialFit, nominal: NDArray[np.float64], seed: int, full_grid: bool, tell: Callable[[float], object]
) -> list[NDArray[np.float64]]:
    """The best candidates, best first."""
    surfaces = fit.size // len(PARAMETERS)
    low, high = np.tile(LOW, surfaces), np.tile(HIGH, surfaces)
    unit = qmc.Sobol(fit.size, seed=seed).random(_CANDIDATES)
    # Few materials are between metal and not, or half clear.
    for k, name in enumerate(PARAMETERS * surfaces):
        if name in ("metallic", "transmission"):
            unit[:, k] = np.clip(1.5 * (unit[:, k] - 0.6) / 0.4, 0.0, 1.0)
    candidates = [nominal, *(low + unit * (high - low))]
    rounds = (_SAMPLES[-1],) if full_grid else _SAMPLES
    total, done = sum(len(candidates) // _KEEP**k * s for k, s in enumerate(rounds)), 0
    for number, samples in enumerate(rounds):
        losses = []
        for theta in candidates:
            losses.append(fit.residuals(theta, samples // 2).loss)
            done += samples
            tell(min(done / total, 1.0))
        order = np.argsort(losses)
        keep = len(candidates) if number == len(rounds) - 1 else max(2, len(candidates) // _KEEP)
        candidates = [candidates[k] for k in order[:keep]]
    return candidates


def _fine(
    fit: MaterialFit, theta: NDArray[np.float64], tell: Callable[[float], object]
) -> tuple[NDArray[np.float64], Residuals, NDArray[np.float64]]:
    """(theta, its residuals, standard deviations), by Levenberg-Marquardt: all renders have the same seeds, so that
    differences are those of the materials."""
    surfaces = fit.size // len(PARAMETERS)
    low, high = np.tile(LOW, surfaces), np.tile(HIGH, surfaces)
    best, damping = fit.residuals(theta, _FINE_SAMPLES), 1e-2
    H = np.eye(fit.size)
    for number in range(_FINE_STEPS):
        J1, J2 = np.empty((2, best.first.size, fit.size))
        for k in range(fit.size):
            width = _STEP if theta[k] + _STEP <= high[k] else -_STEP
            moved = theta.copy()
            moved[k] += width
            other = fit.residuals(moved, _FINE_SAMPLES)
            J1[:, k], J2[:, k] = (other.first - best.first) / width, (other.second - best.second) / width
            tell((number + (k + 1) / (fit.size + 1)) / _FINE_STEPS)
        # Products of the two halves here, too: noise in the derivatives does not shrink the step.
        H = 0.5 * (J1.T @ J2 + J2.T @ J1)
        b = -0.5 * (J1.T @ best.second + J2.T @ best.first)
        diagonal = np.maximum(np.diag(H), 1e-3 * max(float(np.diag(H).max()), 1e-9))
        improved = False
        for _ in range(4):
            step = np.linalg.solve(H + damping * np.diag(diagonal) + 1e-9 * np.eye(fit.size), b)
            moved = np.clip(theta + np.clip(step, -0.3, 0.3), low, high)
            other = fit.residuals(moved, _FINE_SAMPLES)
            if other.loss < best.loss:
                theta, best, damping, improved = moved, other, damping / 5.0, True
                break
            damping *= 8.0
        if not improved:
            break
    values, vectors = np.linalg.eigh(H)
    floor = 1e-6 * max(float(values[-1]), 1e-9)
    variance = _ALIKE * max(best.loss, 1.0) / np.maximum(values, floor)
    tell(1.0)
    return theta, best, np.sqrt(np.einsum("ij,j,ij->i", vectors, variance, vectors) + _FLOOR**2)


def _judged(
    names: list[str], theta: NDArray[np.float64], sigma: NDArray[np.float64], source: str
) -> tuple[dict[str, dict[str, Quantity]], dict[str, tuple[str, ...]]]:
    found: dict[str, dict[str, Quantity]] = {}
    undetermined: dict[str, tuple[str, ...]] = {}
    rows = zip(names, theta.reshape(len(names), -1), sigma.reshape(len(names), -1), strict=True)
    for surface, values, errors in rows:
        half = dict(zip(PARAMETERS, _INTERVAL_90 * errors, strict=True))
        undetermined[surface] = tuple(name for name in PARAMETERS if half[name] > _UNDETERMINED[name])
        found[surface] = {
            name: Quantity(float(v), max(float(v - half[name]), 0.0), min(float(v + half[name]), 1.0), "1", source)
            for name, v in zip(PARAMETERS, values, strict=True)
            if name not in undetermined[surface]
        }
    return found, undetermined
