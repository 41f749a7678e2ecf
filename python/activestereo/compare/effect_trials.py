# SPDX-License-Identifier: Apache-2.0
"""Tries effects on one small test world: matt bodies on a table before a wall, a moving warm rig. Compares an effect's
formula with the engines, and makes pictures that show it.

Both the formula and the engines change the images. Their difference is the RMS of (engine's change - formula's change),
relative to the RMS of the engine's change. Squares are products of two renders with different seeds, so that render
noise cancels. Formula and engine use the same samples, so that the same pixels clip."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Camera, Capture, Frame, ImageKey, Projector, Rig
from activestereo.capture.images import write_gray
from activestereo.common.pattern import PatternDesign, make_pattern
from activestereo.common.pose import look_at
from activestereo.compare.cache import LayerCache
from activestereo.compare.depth_compare import SETTLING_FRAMES, DepthModel, expose
from activestereo.compare.noise import NoiseModel
from activestereo.compare.render import WARP_SCALE, Renderer, render_frames
from activestereo.effects.core.descriptor import Effect, Randomness, Stage
from activestereo.effects.core.model import Model, Nuisances, inverse_depth
from activestereo.effects.core.surfaces import SURFACES
from activestereo.effects.core.view import Layers, View, random_stream
from activestereo.effects.engines.capture_renderer import CaptureRenderer
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter

_SIZE, _FOCAL_PX = (160, 90), 80.0
_SAMPLES, _BOUNCES, _SEEDS = 64, 2, (0, 1)
_NUISANCES = Nuisances(projector_scale=120000.0, ambient_scale=9000.0, black_dn=5.0)
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
    engine, cache = CaptureRenderer(device, _SAMPLES, _BOUNCES, seed, traced=True), LayerCache(folder / "cache")
    layers = render_frames(capture, engine, _SAMPLES, _BOUNCES, seed=seed, cache=cache, scale=WARP_SCALE)
    views = {(f.id, side): View.of(capture, f, side, layers[f.id][side]) for f in capture.frames for side in SIDES}

    def images(model: Model, by_engine: bool) -> Mapping[ImageKey, NDArray]:
        if by_engine:
            return engine.expected(capture, model, _NUISANCES)
        lights = {key: model.light(layers[key[0]][key[1]], view) for key, view in views.items()}
        return {key: model.signal(lights[key], view, _NUISANCES) for key, view in views.items()}

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


# The pictures show the right camera, because effects on the camera geometry move its image.
_SIDE = "right"
_SCALE = 2.0
_STRIP_SAMPLES = 128
_STRENGTHS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
# Three times as much light as _NUISANCES, in which the dots saturate.
_BRIGHT = Nuisances(projector_scale=360000.0, ambient_scale=27000.0, black_dn=5.0)
# An effect that changes fewer pixels than this share cannot be seen.
_LEAST_CHANGED = 1e-3
# Noise of the pairs that are matched; relative 0.01 is a speckle contrast of a tenth.
_NOISE = NoiseModel(offset=1.0, shot=0.02, relative=0.01, black_dn=5.0)


@dataclass(frozen=True)
class EffectStrip:
    """Holds a pair of pictures [height][width], without an effect and with it (with_it), to show the effect. unit of
    both: "DN", "m" of depth or "px" of disparity (0 = none). parameters: the effect's values."""

    effect: Effect
    parameters: dict[str, float]
    unit: str
    without: NDArray[np.float64]
    with_it: NDArray[np.float64]

    @property
    def difference(self) -> NDArray[np.float64]:
        return self.with_it - self.without

    @property
    def stays(self) -> NDArray[np.bool_]:
        """Returns which pixels have a value in both pictures: all of "DN". A pixel that gains or loses its depth
        changes by its whole depth, which is no change of size."""
        return np.full(self.without.shape, self.unit == "DN") | ((self.without > 0) & (self.with_it > 0))

    def rms(self) -> float:
        """Returns the root mean square change of the pixels that stay; 0 if there are none."""
        changes = self.difference[self.stays]
        return float(np.sqrt(np.sum(changes**2) / max(1, changes.size)))

    def filled_and_lost(self) -> tuple[int, int]:
        """Returns how many pixels gain a depth, and how many lose theirs."""
        rows = (self.without, self.with_it), (self.with_it, self.without)
        first, second = (np.count_nonzero(~self.stays & (before <= 0) & (after > 0)) for before, after in rows)
        return first, second


class StripView:
    """Makes EffectStrips of one frame from its rendered layers {side: Layers}. base: a Model whose effects act in both
    pictures; None: none. side: the camera that is shown."""

    def __init__(
        self, capture: Capture, frame: Frame, layers: Mapping[str, Layers], nuisances: Nuisances, side: str = _SIDE,
        base: Model | None = None,
    ) -> None:  # fmt: skip
        self._views = {name: View.of(capture, frame, name, layers[name]) for name in layers}
        self._layers, self._nuisances, self._side = layers, nuisances, side
        self._base = Model() if base is None else base
        self._capture, self._frame = capture, frame
        self._matched: list[NDArray[np.float64]] = []

    def strip(self, effect: Effect, given: Mapping[str, float] | None = None) -> EffectStrip:
        """Computes the pictures without and with the effect. given: {parameter: value} that replace the effect's
        typical values."""
        values = effect.typical_values | ({SURFACES.name: 0.0} if SURFACES in effect.parameters else {})
        values = effect.values(values | dict(given or {}))
        if effect.stage > Stage.DIGITAL:
            return self._depth_strip(effect, values)
        models = self._base, self._base.with_effect(effect, **values)
        images = [self._image(model, self._side) for model in models]
        return EffectStrip(effect, values, "DN", *images)

    def strengths(self, effect: Effect, given: Mapping[str, float] | None = None) -> list[EffectStrip]:
        """Returns EffectStrips at nine strengths: 0 is neutral, 1 the `given` (else typical) values, 2 twice as far
        from neutral, within the range. Parameters that are choices keep their values."""
        values = effect.typical_values | dict(given or {})
        moved = [p for p in effect.parameters if not p.choice and p.name != SURFACES.name]
        strips = []
        for share in _STRENGTHS:
            far = {p.name: p.neutral + share * (values[p.name] - p.neutral) for p in moved}
            own = {p.name: min(max(far[p.name], p.low), p.high) for p in moved}
            strips.append(self.strip(effect, dict(given or {}) | own))
        return strips

    def _image(self, model: Model, side: str) -> NDArray[np.float64]:
        view = self._views[side]
        light = model.light(self._layers[side], view, True)
        return np.asarray(model.signal(light, view, self._nuisances, True), dtype=np.float64)

    def _depth_strip(self, effect: Effect, values: dict[str, float]) -> EffectStrip:
        """Computes both pictures for an effect on disparity or depth. It acts on the true depth. If its typical values
        do not change that, it acts on simsense's depth of noisy pairs. It then runs over enough frames for its memory
        to settle."""
        view, stream = self._views["left"], dict[str, np.ndarray]()
        frames = [np.where(np.isfinite(view.depth_m), view.depth_m, 0.0).astype(np.float64)]
        if np.allclose(Model().with_effect(effect, **effect.typical_values).depth(frames[0], view), frames[0]):
            frames, count = self._matched, SETTLING_FRAMES if effect.remembers else 1
            if len(frames) < count:
                engine, images = DepthModel(self._capture), [self._image(self._base, side) for side in SIDES]
                for draw in range(len(frames), count):
                    rng, most = random_stream(draw, "strip"), self._capture.rig.max_dn
                    pair = [expose(image, self._frame.gain, _NOISE, most, rng) for image in images]
                    frames.append(engine.depth(*pair).astype(np.float64))
            frames = frames[:count]
        model = Model().with_effect(effect, **values)
        for depth in frames:
            changed = model.depth(depth, view, stream)
        if effect.stage is Stage.DEPTH:
            return EffectStrip(effect, values, "m", frames[-1], changed)
        return EffectStrip(effect, values, "px", *(inverse_depth(d, view) for d in (frames[-1], changed)))


class StripWorld(StripView):
    """A StripView of the small test world, rendered once. If an effect is invisible in its light, a strip shows it in
    brighter light."""

    def __init__(self, renderer: Renderer, cache: LayerCache | None = None) -> None:
        with tempfile.TemporaryDirectory() as folder:
            capture = trial_capture(Path(folder), _SCALE)
            frame = capture.frames[0]
            layers = render_frames(capture, renderer, _STRIP_SAMPLES, _BOUNCES, cache=cache, scale=WARP_SCALE)[frame.id]
            super().__init__(capture, frame, layers, _NUISANCES)
            self._bright = StripView(capture, frame, layers, _BRIGHT)

    def strip(self, effect: Effect, given: Mapping[str, float] | None = None) -> EffectStrip:
        shown = super().strip(effect, given)
        if _is_seen(shown) or _is_seen(super().strip(effect)):
            return shown
        return self._bright.strip(effect, given)


def _is_seen(strip: EffectStrip) -> bool:
    return float(np.mean(strip.difference != 0.0)) > _LEAST_CHANGED
