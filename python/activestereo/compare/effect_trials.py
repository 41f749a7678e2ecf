# SPDX-License-Identifier: Apache-2.0
"""Tries effects on one small test world: matt bodies on a table before a wall, a moving warm rig. Compares an effect's
formula with the engines.

Both the formula and the engines change the images. Their difference is the RMS of (engine's change - formula's change),
relative to the RMS of the engine's change. Squares are products of two renders with different seeds, so that render
noise cancels. Formula and engine use the same samples, so that the same pixels clip."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Camera, Capture, Frame, ImageKey, Projector, Rig
from activestereo.capture.images import write_gray
from activestereo.common.pattern import PatternDesign, make_pattern
from activestereo.common.pose import look_at
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import WARP_SCALE, render_frames
from activestereo.effects.core.descriptor import Effect, Randomness
from activestereo.effects.core.model import Model, Nuisances
from activestereo.effects.core.surfaces import SURFACES
from activestereo.effects.core.view import View
from activestereo.effects.engines.capture_renderer import CaptureRenderer
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter

_SIZE, _FOCAL_PX = (160, 90), 80.0
_SAMPLES, BOUNCES, _SEEDS = 64, 2, (0, 1)
NUISANCES = Nuisances(projector_scale=120000.0, ambient_scale=9000.0, black_dn=5.0)
_POSES = (((-0.02, 0.46, 0.72), (0.0, 0.035, -0.02)), ((0.22, 0.38, 0.62), (-0.03, 0.05, -0.05)))


# The images under a model minus those without effects, DN [image][height][width]; by_engine: rendered by the engines,
# else by the effects' formulas.
_Change: TypeAlias = Callable[[Model, bool], NDArray[np.float64]]


class Trial:
    """Compares effects with the engines in the small test world, rendered with two seeds. Its files lie in `folder`."""

    def __init__(self, folder: Path, device: str | int = "auto") -> None:
        capture = trial_capture(folder)
        self._changes = [_change_of(capture, folder, device, seed) for seed in _SEEDS]

    def difference(self, effect: Effect) -> float:
        """Returns the relative difference between formula and engine for an effect at typical values, on all surfaces.
        Parameters that the engines do not take (Parameter.in_engine) get the values at which the formula fits best."""
        if all(name.startswith(("signal.", "speckle")) for name in effect.engine_fields):
            return 0.0  # simsense's signal counts in both
        # Effects with a random pattern draw it from the seed, so they compare images of one seed.
        changes = self._changes if effect.randomness is Randomness.NONE else 2 * self._changes[:1]
        chosen = {p.name: p.neutral for p in effect.parameters if p == SURFACES or not p.in_engine}
        values = effect.typical_values | chosen
        engine, engine_2 = (change(_drawn(effect, values), True) for change in changes)

        def off(values: dict[str, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            formula, formula_2 = (change(_drawn(effect, values), False) for change in changes)
            return engine - formula, engine_2 - formula_2

        left, left_2 = off(values)
        for p in effect.parameters:
            if not p.in_engine:
                far = p.low if values[p.name] > 0.5 * (p.low + p.high) else p.high
                slope, slope_2 = (a - b for a, b in zip((left, left_2), off(values | {p.name: far}), strict=True))
                share = np.mean(slope * left_2 + slope_2 * left) / (2.0 * np.mean(slope * slope_2))
                values[p.name] += (far - values[p.name]) * float(np.clip(share, 0.0, 1.0))
                left, left_2 = off(values)
        return float(np.sqrt(max(float(np.mean(left * left_2)), 0.0) / np.mean(engine * engine_2)))


def _change_of(capture: Capture, folder: Path, device: str | int, seed: int) -> _Change:
    """Renders the small test world with one seed; returns the function that computes a model's change."""
    engine, cache = CaptureRenderer(device, _SAMPLES, BOUNCES, seed, traced=True), LayerCache(folder / "cache")
    layers = render_frames(capture, engine, _SAMPLES, BOUNCES, seed=seed, cache=cache, scale=WARP_SCALE)
    views = {(f.id, side): View.of(capture, f, side, layers[f.id][side]) for f in capture.frames for side in SIDES}

    def images(model: Model, by_engine: bool) -> Mapping[ImageKey, NDArray]:
        if by_engine:
            return engine.expected(capture, model, NUISANCES)
        lights = {key: model.light(layers[key[0]][key[1]], view) for key, view in views.items()}
        return {key: model.signal(lights[key], view, NUISANCES) for key, view in views.items()}

    without = {way: images(Model(), way) for way in (True, False)}

    def change(model: Model, by_engine: bool) -> NDArray[np.float64]:
        seen = images(model, by_engine)
        return np.stack([seen[key].astype(np.float64) - base for key, base in without[by_engine].items()])

    return change


def _drawn(effect: Effect, values: dict[str, float]) -> Model:
    model = Model().with_effect(effect, **values)
    return Model(tuple((replace(e, randomness=Randomness.NONE), p) for e, p in model.effects))


def differences(effects: Iterable[Effect], device: str | int = "auto") -> Iterator[tuple[str, float]]:
    """Yields (id, relative difference between formula and engine) of each effect that has engine fields."""
    in_engines = [e for e in effects if e.engine is not None]
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(Path(folder), device) if in_engines else None
        for e in in_engines:
            assert trial is not None
            yield e.id, trial.difference(e)


def trial_capture(folder: Path, scale: float = 1.0) -> Capture:
    """Writes the small test world's scene and pattern into a folder and returns its capture, without images. scale:
    factor on the images' size."""
    scene, pattern = folder / "trial.gltf", folder / "pattern.png"
    writer = GltfWriter("activestereo trial world")  # closed matt bodies: light may wander below their surfaces
    matt = {"extensions": {"KHR_materials_specular": {"specularFactor": 0.0}}}
    surface = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    table, wall, clay, card = (
        writer.add_material(name, pbrMetallicRoughness=surface, extras={"ir_albedo": albedo}, **matt)
        for name, albedo in (("table", 0.5), ("wall", 0.6), ("clay", 0.55), ("card", 0.7))
    )
    writer.add_mesh("table", meshes.box(1.7, 0.04, 0.95), table, (0.0, -0.04, -0.02))
    writer.add_mesh("wall", meshes.box(3.2, 2.2, 0.1), wall, (0.0, -0.8, -0.55))
    writer.add_mesh("ball", meshes.sphere(0.06), clay, (-0.2, 0.06, 0.05))
    writer.add_mesh("ring", meshes.torus(0.052, 0.02), clay, (0.0, 0.0, 0.13))
    writer.add_mesh("box", meshes.box(0.17, 0.12, 0.10), card, (0.15, 0.0, -0.16), yaw_deg=-14.0)
    writer.write(scene)
    design = PatternDesign(width=530, height=300, dot_pitch_px=14.4, dot_sigma_px=1.6, seed=2)
    write_gray(pattern, make_pattern(design))
    (width, height), focal_px = (round(scale * side) for side in _SIZE), scale * _FOCAL_PX
    k = np.array([[focal_px, 0.0, (width - 1) / 2], [0.0, focal_px, (height - 1) / 2], [0.0, 0.0, 1.0]])
    projector_k = np.array([[214.0, 0.0, 264.5], [0.0, 214.0, 149.5], [0.0, 0.0, 1.0]])
    left_to_right, left_to_projector = np.eye(4), np.eye(4)
    left_to_right[0, 3], left_to_projector[0, 3] = -0.05, -0.029
    camera = Camera(width, height, k)
    rig = Rig(camera, camera, left_to_right, Projector(pattern, projector_k, left_to_projector), line_time_s=1e-5)
    frames = tuple(
        Frame(
            id=i,
            left_path=None,
            right_path=None,
            timestamp_s=2.003 + i,
            exposure_s=0.004 / (1 + i),
            gain=1.0 + i,
            temperature_c=45.0,
            camera_to_world=look_at(position, target, (0.0, 1.0, 0.0)),
            split="train",
            camera_velocity=np.array([1.8, 0.6, 0.6, 1.2, 7.2, 3.6]),
        )
        for i, (position, target) in enumerate(_POSES)
    )
    return Capture(folder, "trial", scene, rig, frames)
