# SPDX-License-Identifier: Apache-2.0
"""The one renderer of captures: layers of the base model, and frames under a model. Effects with an engine function act
inside of the engines."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.capture.capture import SIDES, Capture, Frame, ImageKey
from activestereo.common.computed_once import computed_once
from activestereo.common.progress_bar import Progress, part_of
from activestereo.effects.core.engine import EngineInputs, apply_engine
from activestereo.effects.core.model import Model, Nuisances
from activestereo.effects.core.view import Layers, View
from activestereo.effects.engines.base_layers import (
    FLAT_SHARE,
    MATT_VERSION,
    FirstSurfaces,
    is_matt_world,
    matt_layers,
    traced_layers,
)
from activestereo.effects.engines.capture_inputs import (
    SceneMeasurement,
    capture_inputs,
    changed_world,
    copy_later,
    copy_record,
    keeps_surfaces,
    record_key,
    world_key,
)
from activestereo.effects.engines.layers import RenderRequest, scene_digest
from activestereo.effects.engines.loaded_scene import BOUNCED_VERSION, GEOMETRY, LIGHT, LoadedScene, engine_version
from activestereo.effects.engines.smooth import SMOOTH_VERSION, halves, is_filtered

# Lights that effects add have a light group of their own, since only the room's light is scaled.
_ADDED_GROUP = 1
# Where added lamps render alone, their light gets these shares of the samples: a first reflection has no noise but at
# the edges of pixels, and bounced light is smooth.
_ONCE_SHARE, _BOUNCED_SHARE = 0.5, 0.125
# The number of renders that are remembered.
_KEPT = 3


class _Lit(Enum):
    """The lights of one render: the rig's projector and the added lamps, the added lamps alone, or the added projectors
    alone. All projectors share one pair of outputs, so they need renders of their own."""

    RIG_AND_LAMPS = "rig and lamps"
    LAMPS = "lamps"
    UNITS = "units"


_Poses = list[list[tuple[Frame, EngineInputs]]]  # the frames that share each pose's images, with their own inputs


class CaptureRenderer:
    """Renders captures in kuafu. Call it for a RenderRequest's layers; lights() and expected() render frames under a
    model. The latest scene stays loaded, as in its file; an edited file is loaded again.

    device: 'auto', 'cpu', an index or a kuafu.Device. samples_per_pixel, max_bounces, seed: of frames under a model; a
    request has its own. Every call uses the same seed, and frames have the same positions in the batch. Images of two
    models therefore differ by the models alone, not by noise. smooth: filters bounced and ambient light on matt
    surfaces, see smooth.py. traced: path-traces the layers of matt worlds, too, with the noise of frames under a model.
    Raises kuafu.NoDeviceError or kuafu.FileError.
    """

    def __init__(
        self,
        device: str | int | kuafu.Device = "auto",
        samples_per_pixel: int = 64,
        max_bounces: int = 8,
        seed: int = 0,
        smooth: bool = True,
        traced: bool = False,
    ) -> None:
        self.device = device if isinstance(device, kuafu.Device) else kuafu.Device(device)
        self.samples_per_pixel, self.max_bounces, self.seed = samples_per_pixel, max_bounces, seed
        self._smooth, self._traced = smooth, traced
        self._scene: LoadedScene | None = None
        self._digest = ""
        self._first: dict[str, FirstSurfaces] = {}
        self._kept: dict[tuple, list[list[dict[str, NDArray]]]] = {}
        self._one_at_a_time = threading.RLock()
        smoothed = f", smoothed {SMOOTH_VERSION}" if smooth else ""
        way = f"bounced {BOUNCED_VERSION}, {'traced' if traced else f'matt {MATT_VERSION}'}"
        self.version = f"{engine_version(self.device)}{smoothed}, flat {FLAT_SHARE}, {way}"

    @contextmanager
    def _loaded(self, scene_path: Path) -> Iterator[LoadedScene]:
        """Gives the loaded scene to one thread at a time. After an error the next call loads the scene again, since the
        old one may hold changes."""
        with self._one_at_a_time:
            digest = scene_digest(scene_path)
            if self._scene is None or digest != self._digest:
                self._scene, self._digest = LoadedScene(scene_path, self.device, self._smooth), digest
                self._first, self._kept = {}, {}
            try:
                yield self._scene
            except BaseException:
                self._scene = None
                raise

    def __call__(self, request: RenderRequest, progress: Progress | None = None) -> tuple[Layers, ...]:
        """Renders a request; returns one Layers per camera. progress: called as progress(fraction done)."""
        with self._loaded(request.scene_path) as world:
            may_be_matt = self._smooth and not self._traced
            if may_be_matt and is_matt_world(world.scene, world.room is not None):
                return matt_layers(world, request, self._first, progress)
            return traced_layers(world, request, progress)

    def filtering_alike(self, capture: Capture, model: Model) -> CaptureRenderer:
        """Returns the renderer for the difference that a model makes to light. Filters blur the edges of surfaces a
        little. If they leave out surfaces of the model, the difference would show the edges, so it is unfiltered."""
        [(_, inputs)] = self.inputs(capture, model, capture.frames[:1], None)
        return self if all(map(is_filtered, inputs.materials.values())) else self._unfiltered()

    @computed_once
    def _unfiltered(self) -> CaptureRenderer:
        return CaptureRenderer(self.device, self.samples_per_pixel, self.max_bounces, self.seed, smooth=False)

    def inputs(
        self, capture: Capture, model: Model, frames: Iterable[Frame] | None, scene_measurement: SceneMeasurement | None
    ) -> list[tuple[Frame, EngineInputs]]:
        """Returns (frame, the engines' inputs) of each frame; frames=None: all of the capture. The inputs are
        calibration and settings, the scene measurement's corrections, then the model's deterministic effects. Random
        effects are left out, since images are expected values."""
        pattern, made = capture.rig.projector.pattern(), []
        expected = [(e, e.on_pixels(p, capture.binning)) for e, p in model.effects if e.is_in_mean]
        with self._loaded(capture.scene_path) as world:
            for frame in capture.frames if frames is None else frames:
                inputs = capture_inputs(capture, frame, world.scene, pattern, self.seed)
                if scene_measurement is not None:
                    scene_measurement.apply(inputs)
                apply_engine(inputs, tuple(expected))
                made.append((frame, inputs))
        return made

    def lights(
        self,
        capture: Capture,
        model: Model,
        frames: Iterable[Frame] | None = None,
        scene_measurement: SceneMeasurement | None = None,
        progress: Progress | None = None,
        half: int | None = None,
    ) -> dict[ImageKey, Layers]:
        """Returns {(frame id, side): Layers} of the frames, all by default. Frames that differ only in exposure, power
        or gain share their images. All poses with the same materials and medium are one render. half: 0 or 1, one of
        two independent halves of the samples (smooth.py); None: all samples."""
        worlds = _worlds(self.inputs(capture, model, frames, scene_measurement))
        out: dict[ImageKey, Layers] = {}
        for done, group in enumerate(worlds):
            share = part_of(progress, done / len(worlds), (done + 1) / len(worlds))
            images = self._images(capture.scene_path, [at_pose[0][1] for at_pose in group], share, half)
            for at_pose, sides in zip(group, images, strict=True):
                out |= {
                    (frame.id, side): _side_light(view, own)
                    for frame, own in at_pose
                    for side, view in zip(SIDES, sides, strict=True)
                }
        return out

    def added_light(
        self, capture: Capture, model: Model, frames: Iterable[Frame]
    ) -> dict[ImageKey, NDArray[np.float32]]:
        """Returns {(frame id, side): radiance [height][width]} of the lights that a model's effects add, without any
        other light. A lamp's light takes a fifth of the time of two renders with all light, and has less noise."""
        out: dict[ImageKey, NDArray[np.float32]] = {}
        with self._loaded(capture.scene_path) as world:
            for group in _worlds(self.inputs(capture, model, frames, None)):
                poses = [at_pose[0][1] for at_pose in group]
                with changed_world(world.scene, poses[0]), world.dark():
                    views = self._by_side(world, poses, self._added(world, poses))
                for at_pose, sides in zip(group, views, strict=True):
                    lights = [(view["added"] + view["added_indirect"])[..., 0].astype(np.float32) for view in sides]
                    out |= {(frame.id, side): x for frame, _ in at_pose for side, x in zip(SIDES, lights, strict=True)}
        return out

    def lights_key(self, frames: Iterable[tuple[Frame, EngineInputs]], half: int | None) -> str:
        """Returns a hash of all that decides lights(), but for the scene's files and the engine's version. It is equal
        in every process. frames: as inputs() returns them."""
        inputs = [own for _, own in frames]
        powers = [(i.frame.id, i.projector and i.projector.ir_intensity) for i in inputs]
        smooth = self._smooth and SMOOTH_VERSION
        settings = self.samples_per_pixel, self.max_bounces, self.seed, half, smooth, BOUNCED_VERSION
        return hashlib.sha256(repr((settings, powers, [_pose_key(i) for i in inputs])).encode()).hexdigest()

    def expected(
        self, capture: Capture, model: Model, nuisances: Nuisances, scene_measurement: SceneMeasurement | None = None
    ) -> dict[ImageKey, NDArray[np.float32]]:
        """Returns {(frame id, side): expected DN [height][width]} of all frames. Raises ValueError for an effect on
        light that no engine field expresses: compare() applies these."""
        if outside := [e.id for e, values in model.on_light() if not e.is_simulated(values)]:
            raise ValueError(f"{', '.join(outside)}: no engine field expresses it; compare() applies image functions")
        frames, out = {frame.id: frame for frame in capture.frames}, {}
        for (number, side), light in self.lights(capture, model, None, scene_measurement).items():
            view = View.of(capture, frames[number], side, light, self.seed)
            out[number, side] = model.signal(light, view, nuisances).astype(np.float32)
        return out

    # ---- inside ----

    def _images(
        self, scene_path: Path, poses: list[EngineInputs], progress: Progress | None, half: int | None
    ) -> list[list[dict[str, NDArray]]]:
        """Returns the rendered images, {output: image}, by pose and side: [pose][side]. The latest renders are kept,
        for changes that leave all rays as they are."""
        key = (half, *map(_pose_key, poses))
        with self._loaded(scene_path) as world:
            if key not in self._kept:
                with changed_world(world.scene, poses[0]):
                    self._kept[key] = self._render_world(world, poses, progress, half)
                while len(self._kept) > _KEPT:
                    self._kept.pop(next(iter(self._kept)))
            return self._kept[key]

    def _render_world(
        self, world: LoadedScene, poses: list[EngineInputs], progress: Progress | None, half: int | None
    ) -> list[list[dict[str, NDArray]]]:
        images = self._render(world, poses, LIGHT + GEOMETRY, _Lit.RIG_AND_LAMPS, progress, half)
        if _has(poses, _Lit.UNITS):  # added projectors count as ambient light
            others = self._render(world, poses, LIGHT[:2], _Lit.UNITS, half=half)
            images["added"] = images["added"] + others["projector_direct"]
            images["added_indirect"] = others["projector_indirect"]
        return self._by_side(world, poses, images)

    def _added(self, world: LoadedScene, poses: list[EngineInputs]) -> dict[str, NDArray]:
        """Renders the added lights of all poses in a dark world; returns "added", reflected once, "added_indirect", and
        the surfaces' geometry."""
        some, few = (max(1, round(share * self.samples_per_pixel)) for share in (_ONCE_SHARE, _BOUNCED_SHARE))
        images = self._render(world, poses, GEOMETRY, _Lit.LAMPS, samples=few)
        if _has(poses, _Lit.LAMPS):
            once, again = (
                self._render(world, poses, GEOMETRY[:1], _Lit.LAMPS, samples=samples, max_bounces=0)["added"]
                for samples in (some, few)
            )
            images["added"], images["added_indirect"] = once, images["added"] - again
        if _has(poses, _Lit.UNITS):
            dots = self._render(world, poses, LIGHT[:1], _Lit.UNITS, max_bounces=0)
            bounced = self._render(world, poses, LIGHT[1:2], _Lit.UNITS, samples=few)
            images["added"] = images["added"] + dots["projector_direct"]
            images["added_indirect"] = images["added_indirect"] + bounced["projector_indirect"]
        return images

    def _by_side(
        self, world: LoadedScene, poses: list[EngineInputs], images: dict[str, NDArray]
    ) -> list[list[dict[str, NDArray]]]:
        """Returns rendered images, filtered where they are smooth, by pose and side."""
        views = world.views(images, [side.camera for inputs in poses for side in inputs.sides])
        return [views[k : k + len(SIDES)] for k in range(0, len(views), len(SIDES))]

    def _render(
        self,
        world: LoadedScene,
        poses: list[EngineInputs],
        outputs: tuple[str, ...],
        lit: _Lit,
        progress: Progress | None = None,
        half: int | None = None,
        samples: int | None = None,
        max_bounces: int | None = None,
    ) -> dict[str, NDArray]:
        """Renders all poses in one call and returns {output: [camera][height][width][channels]}. The rig's projector
        has 1 W/sr. half: 0 or 1, one of two independent halves of the samples; None: all samples. samples,
        max_bounces: None: the renderer's own."""
        lights: list[tuple[kuafu.Light, NDArray | None]] = []
        has_lamps = lit is not _Lit.UNITS and _has(poses, _Lit.LAMPS)
        group = (f"light_group_{_ADDED_GROUP}",) if has_lamps else ()
        # Each environment is the lights of one moment: (pose, seconds after its time), shared by cameras.
        moment_of = [(number, side.delay_s) for number, inputs in enumerate(poses) for side in inputs.sides]
        moments = list(dict.fromkeys(moment_of))
        for environment, (number, delay_s) in enumerate(moments):
            for light in _lights(poses[number], lit, delay_s):
                light.environment, light.light_group = environment, _ADDED_GROUP
                lights.append((light, poses[number].pattern if light.kind == "projector" else None))
        samples, seed = samples or self.samples_per_pixel, self.seed
        if half is not None:
            samples, seeds = halves(samples, seed)
            seed = seeds[half]
        sides = [side for inputs in poses for side in inputs.sides]
        with world.lit(lights):
            images = world.images(
                [copy_later(side.camera, side.delay_s) for side in sides],
                outputs + group,
                samples,
                self.max_bounces if max_bounces is None else max_bounces,
                progress,
                keeps_surfaces=all(map(keeps_surfaces, poses)),
                environments=list(map(moments.index, moment_of)),
                optics=[side.optics for side in sides],
                seed=seed,
            )
        images["added"] = images.pop(*group) if has_lamps else np.zeros_like(images[outputs[0]])
        images["added_indirect"] = np.zeros_like(images["added"])
        if "ambient" in images:
            images["ambient"] = images["ambient"] - images["added"]
        return images


def _worlds(frames: Iterable[tuple[Frame, EngineInputs]]) -> list[_Poses]:
    """Groups frames by the materials and the medium that all poses of one render share, then by pose."""
    poses: dict[tuple, list[tuple[Frame, EngineInputs]]] = {}
    for frame, inputs in frames:
        poses.setdefault(_pose_key(inputs), []).append((frame, inputs))
    worlds: dict[tuple, _Poses] = {}
    for at_pose in poses.values():
        worlds.setdefault(world_key(at_pose[0][1]), []).append(at_pose)
    return list(worlds.values())


def _has(poses: list[EngineInputs], lit: _Lit) -> bool:
    """Returns whether any added light belongs to the render `lit`: projectors to UNITS, lamps to the others."""
    return any((light.kind == "projector") == (lit is _Lit.UNITS) for inputs in poses for light in inputs.added_lights)


def _lights(inputs: EngineInputs, lit: _Lit, delay_s: float) -> list[kuafu.Light]:
    """Returns copies of the lights of one render. Lights on the rig are moved to their pose at delay_s. The rig's
    projector has 1 W/sr; its power scales the images afterwards."""
    added = [copy_later(x, delay_s) for x in inputs.rig_lights] + [copy_record(x) for x in inputs.lights]
    lights = [light for light in added if (light.kind == "projector") == (lit is _Lit.UNITS)]
    if lit is _Lit.RIG_AND_LAMPS and inputs.projector is not None:
        lights.insert(0, copy_record(copy_later(inputs.projector, delay_s), ir_intensity=1.0))
    return lights


def _pose_key(inputs: EngineInputs) -> tuple:
    """Returns a key that is equal for poses with equal images. It leaves out the projector's power, which scales them
    afterwards, and the shutter of a rig at rest. So these poses have the same place in a batch, and the same random
    numbers, with an effect of motion and without."""
    times = {} if inputs.frame.is_moving else dict.fromkeys(("exposure_s", "line_time_s"), 0.0)
    cameras = (copy_record(side.camera, **times) for side in inputs.sides)
    sides = tuple(
        (record_key(camera), record_key(side.optics), side.delay_s)
        for camera, side in zip(cameras, inputs.sides, strict=True)
    )
    projector = () if inputs.projector is None else record_key(copy_record(inputs.projector, ir_intensity=1.0))
    pattern = hashlib.sha256(b"" if inputs.pattern is None else inputs.pattern.tobytes())
    return (*sides, projector, pattern.digest(), tuple(map(record_key, inputs.added_lights)), world_key(inputs))


def _side_light(view: dict[str, NDArray], inputs: EngineInputs) -> Layers:
    """Makes the Layers of one rendered camera, scaled by the projector's power in a frame's inputs. view: {output:
    [height][width][channels]}."""
    power = 0.0 if inputs.projector is None else inputs.projector.ir_intensity
    ambient = view["ambient"] + view["added"] + view["added_indirect"]
    lights = (power * view["projector_direct"], power * view["projector_indirect"], ambient, view["depth"])
    direct, indirect, room, depth = (image[..., 0].astype(np.float32) for image in lights)
    return Layers(
        direct, indirect, room, np.full_like(direct, np.nan), depth, view["normal"], view["material_id"][..., 0]
    )
