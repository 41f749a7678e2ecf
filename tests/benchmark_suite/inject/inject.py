# SPDX-License-Identifier: Apache-2.0
"""Copies a capture with one more effect in its measured infrared images, and writes the answer into the copy."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from inject.effects import Light, View, moved_depth
from inject.kinds import KINDS, Kind
from inject.noise import NoiseModel, measured_noise_model, with_noise

from activestereo.capture.capture import SIDES, SPLITS, Capture, Frame
from activestereo.capture.images import read_gray, write_gray
from activestereo.common.input_files import read_bytes, read_json
from activestereo.common.shown import unknown
from activestereo.common.output_files import new_folder, write_bytes, write_text
from activestereo.common.progress_bar import ProgressBar

ANSWER = "answer.json"
_DARKEST = 0.001  # share of darkest pixels, taken for black if nothing better is known
_ROW_TIME_S = 2e-5  # assumed for a capture that states none


@dataclass(frozen=True)
class Injection:
    """One effect to put into a capture's images, with everything on which the changed images depend."""

    capture: Capture
    name: str
    strength: str
    value: float
    sides: tuple[str, ...]
    drawn: Mapping[str, float]
    seed: int
    black_dn: float
    noise_model: NoiseModel

    @property
    def kind(self) -> Kind:
        return KINDS[self.name]

    @property
    def parameters(self) -> dict[str, float]:
        """Returns the effect's true parameters."""
        scale = self.capture.rig.max_dn / 255.0 if self.kind.in_dn else 1.0
        return {self.kind.parameter: self.value * scale, **self.drawn}

    def changed(self, number: int, side: str) -> np.ndarray:
        """Returns one changed infrared image in whole DN. number: the frame's place in the capture."""
        frame, rig = self.capture.frames[number], self.capture.rig
        measured = self.capture.ir(frame, side).astype(np.float64)
        if side not in self.sides or (self.name == "dead_dots" and frame.projector_power == 0.0):
            return measured
        light = Light(measured - self.black_dn, self.noise_model.variance(measured - self.black_dn))
        view = self._view(number, side)
        try:
            light = self.kind.apply(light, view, **self.parameters)
        except ValueError as error:
            raise ValueError(f"{self.capture.path}: frames[id={frame.id}] {error}") from error
        if not self.kind.behind_noise:
            light = with_noise(light, self.noise_model, view.temporal)
        return np.clip(np.rint(light.value + self.black_dn), 0, rig.max_dn)

    def _view(self, number: int, side: str) -> View:
        frame, rig = self.capture.frames[number], self.capture.rig
        is_right = side == "right"
        camera_to_left = np.linalg.inv(rig.left_to_right) if is_right else np.eye(4)
        pattern = rig.projector.pattern()
        return View(
            K=rig.camera(side).K,
            is_right=is_right,
            time_s=frame.timestamp_s,
            row_time_s=rig.line_time_s or _ROW_TIME_S,
            max_dn=rig.max_dn - self.black_dn,
            depth=self._depth(frame, is_right) if self.name == "dead_dots" else None,
            camera_to_projector=np.asarray(rig.projector.left_to_projector @ camera_to_left, np.float64),
            projector_K=rig.projector.K,
            projector_size=(pattern.shape[1], pattern.shape[0]),
            temporal=_generator(self.seed, number, is_right),
            static=_generator(self.seed),
        )

    def _depth(self, frame: Frame, is_right: bool) -> np.ndarray | None:
        """One camera's depth in metres, [height][width], of this frame or a repeat of it; None without depth."""
        group = frame.repeat_group
        repeats = [f for f in self.capture.frames if group is not None and f.repeat_group == group]
        told = next((f for f in (frame, *repeats) if f.depth_path is not None), frame)
        depth, rig = self.capture.depth(told), self.capture.rig
        if depth is None or not is_right:
            return None if depth is None else depth.astype(np.float64)
        return moved_depth(depth.astype(np.float64), rig.left.K, rig.left_to_right, rig.right.K)


def _generator(*key: int | bool) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64([int(part) for part in key]))


def plan(capture: Capture, name: str, strength: str, seed: int, black_dn: float | None = None) -> Injection:
    """Returns the Injection of the effect `name`. strength: one of STRENGTHS or a number. black_dn: the black level;
    None takes the darkest pixels. Raises ValueError with the fault."""
    if name not in KINDS:
        raise ValueError(unknown("effect", name, KINDS))
    kind = KINDS[name]
    try:
        value = kind.value(strength)
    except ValueError as error:
        raise ValueError(f"the strength of {name} {error}") from error
    if not any(frame.has_infrared for frame in capture.frames):
        raise ValueError(f"{capture.path}: there are no infrared images to put an effect into")
    choice = _generator(seed, crc32(name.encode()))
    sides = (SIDES[int(choice.integers(2))],) if kind.one_camera else SIDES
    black = darkest(capture) if black_dn is None else black_dn
    if not 0.0 <= black < capture.rig.max_dn:
        raise ValueError(f"the black level is {black:g}, expected 0 to below {capture.rig.max_dn} DN")
    noise_model = measured_noise_model(capture, black)
    return Injection(capture, name, strength, value, sides, kind.drawn(choice), seed, black, noise_model)


def darkest(capture: Capture) -> float:
    """Returns the value in DN below which a thousandth of all infrared pixels lie."""
    images = [capture.ir(frame, side).ravel() for frame in capture.frames if frame.has_infrared for side in SIDES]
    return float(np.quantile(np.concatenate(images), _DARKEST, method="lower"))


def write_injected(injection: Injection, out: Path, bar: ProgressBar | None = None) -> dict[str, Any]:
    """Writes the capture with the effect in its infrared images as the new folder `out`; returns its answer.json."""
    capture = injection.capture
    home = capture.path.resolve()
    if out.resolve().is_relative_to(home):
        raise ValueError(f"{out} lies in the capture {capture.path}: give a place beside it")
    for frame in capture.frames:
        for side in SIDES if frame.has_infrared else ():
            if not frame.path(side).resolve().is_relative_to(home):
                raise ValueError(f"{frame.path(side)} lies outside of {capture.path}: move it into the folder")
    differences: dict[str, list[float]] = {split: [] for split in SPLITS}
    with new_folder(out) as folder:
        for path in sorted(home.rglob("*")):
            if path.is_file():
                place = folder / path.relative_to(home)
                place.parent.mkdir(parents=True, exist_ok=True)
                write_bytes(place, read_bytes(path))
        for number, frame in enumerate(capture.frames):
            for side in SIDES if frame.has_infrared else ():
                stored, pixels = read_gray(frame.path(side)), injection.changed(number, side)
                differences[frame.split].append(float(np.mean((pixels - stored) ** 2)))
                write_gray(folder / frame.path(side).resolve().relative_to(home), pixels.astype(stored.dtype))
            if bar is not None:
                bar((number + 1) / len(capture.frames))
        answer = _answer(injection, differences)
        write_text(folder / ANSWER, json.dumps(answer, indent=1) + "\n")
    return answer


def _answer(injection: Injection, differences: Mapping[str, list[float]]) -> dict[str, Any]:
    kind, noise_model, before = injection.kind, injection.noise_model, injection.capture.path / ANSWER
    answer: dict[str, Any] = {
        "format": "active-stereo-injected-effect",
        "version": 1,
        "effect": injection.name,
        "accepted": list(kind.accepted),
        "strength": injection.strength,
        "cameras": list(injection.sides),
        "parameters": injection.parameters,
        "seed": injection.seed,
        "black_level_dn": injection.black_dn,
        "noise": {
            "floor_dn2": noise_model.floor_dn2,
            "slope_dn": noise_model.slope_dn,
            "measured": noise_model.measured,
        },
        "changed_rms_dn": {split: float(np.sqrt(np.mean(all_))) for split, all_ in differences.items() if all_},
    }
    if before.is_file():
        answer["hidden_before"] = read_json(before)
    return answer
