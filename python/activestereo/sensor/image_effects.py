# SPDX-License-Identifier: Apache-2.0
"""Applies effects that neither renderer nor depth engine computes to a simulated sensor's images. It copies the images
between the stages.

Effects on light act after the camera's optics, effects on charge before the imager, effects on counts after the imager.
Effects on disparity and depth act after the matcher.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.camera.plan import registered
from activestereo.capture.capture import SIDES
from activestereo.effects.core.descriptor import Effect, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.light import Light
from activestereo.effects.core.model import Model
from activestereo.effects.core.view import View
from activestereo.sensor.pictures import IrLink, dn_per_radiance

Pictures = dict[str, NDArray[Any]]
_GEOMETRY = ("depth", "normal", "material_id")
_LIGHT = ("ambient", "albedo", "projector_direct", "projector_indirect", "projector_visibility", "projector_geometry")


class ModelCostWarning(UserWarning):
    """Warns of effects that neither renderer nor depth engine computes, which cost a copy of every picture."""


class ImageEffects:
    """Applies to a StereoDepthSensor's images those effects that neither renderer nor depth engine computes. effects:
    pairs (Effect, {parameter: value}). make_light: whether on_light() computes the infrared pair, so that SensorEngine
    need not render it."""

    def __init__(self, sensor: Any, effects: Sequence[tuple[Effect, dict[str, float]]]) -> None:
        self._sensor = sensor
        self._effects = tuple(effects)
        self._matcher: simsense.Engine | None = None
        self._stream: dict[str, NDArray[Any]] = {}
        self.make_light = bool(self._of_stages(Stage.PROJECTOR, Stage.OPTICS).effects)

    def on_light(self, link: IrLink, is_laser_apart: bool) -> None:
        """Applies the effects on light and on the pixels' charge to the infrared pair, in place in `link`.
        is_laser_apart: the link also holds images of the projector's light alone."""
        before, charge = self._of_stages(Stage.PROJECTOR, Stage.OPTICS), self._of_stages(Stage.CHARGE, Stage.CHARGE)
        if not before.effects and not charge.effects:
            return
        inputs, images = self._sensor.engine_inputs(), link.images()
        lasers = link.laser().images() if is_laser_apart else None
        power = 0.0 if inputs.projector is None else float(inputs.projector.ir_intensity or 0.0)
        lights = _LIGHT if power > 0.0 else _LIGHT[:1]
        names = _GEOMETRY + lights if before.effects else _GEOMETRY
        for i, (side, part) in enumerate(zip(SIDES, inputs.sides, strict=True)):
            seen = self._sensor.get_pictures(names, side)
            view = self._view(side, inputs, seen)
            if before.effects:
                ambient = max(inputs.ambient_radiance, 1e-30)
                light = before.light(_light(seen, power, ambient), view, random=True)
                images[i] = power * light.projector + ambient * light.ambient
                if lasers is not None:
                    lasers[i] = power * light.projector
            if charge.effects:
                dn = dn_per_radiance(part.signal)
                images[i] = charge.digital(images[i] * dn, view, 0.0, random=True) / dn if dn > 0 else images[i]
        link.put(images)
        if lasers is not None:
            link.laser().put(lasers)

    def depth(
        self, engine: simsense.Engine, pair: tuple[Any, Any], outputs: tuple[str, ...], **lasers: Any
    ) -> dict[str, NDArray]:
        """Computes engine.compute()'s maps with effects: first on the imagers' counts, then on disparity and depth.
        Arguments are compute()'s."""
        counts, matched = self._of_stages(Stage.READOUT, Stage.DIGITAL), self._of_stages(Stage.DISPARITY, Stage.DEPTH)
        wanted = (*outputs, "depth") if matched.effects else outputs
        if not counts.effects:
            result = dict(engine.compute(*pair, wanted, **lasers))
        else:
            inputs, light = self._sensor.engine_inputs(), []
            bits = {name: int(inputs.left.signal[name]) for name in ("bit_depth", "extra_bits")}
            steps, dtype = 2 ** bits["extra_bits"], np.uint8 if sum(bits.values()) == 8 else np.uint16
            seen = engine.compute(*pair, dict.fromkeys(("ir_left", "ir_right"), dtype), **lasers)
            for side, part in zip(SIDES, inputs.sides, strict=True):
                image, black = seen[f"ir_{side}"] / steps, part.signal["black_level_dn"]
                view = self._view(side, inputs, self._sensor.get_pictures(_GEOMETRY, side))
                value = counts.digital(image - black, view, black, random=True)
                light.append((np.rint(steps * value) / steps).astype(np.float32))
            # A second engine, whose imager changes nothing, matches the changed counts.
            self._matcher = self._matcher or self._sensor.make_engine()
            neutral = simsense.signal_preset("neutral") | bits
            self._matcher.set_signal(neutral, neutral)
            result = dict(self._matcher.compute(light[0], light[1], wanted))
        if not matched.effects:
            return result
        k, baseline_m, left_to_rectified = engine.rectified
        view = self._view("left", self._sensor.engine_inputs(), self._sensor.get_pictures(_GEOMETRY, "left"))
        depth = matched.depth(result["depth"], view, self._stream).astype(np.float32)
        disparity = np.divide(k[0, 0] * baseline_m, depth, out=np.full_like(depth, -1.0), where=depth > 0)
        depth_rgb = registered(depth, k, left_to_rectified, self._sensor.plan)
        return result | {"disparity": disparity, "depth_rgb": depth_rgb}

    # ---- inside ----

    def _of_stages(self, first: Stage, last: Stage) -> Model:
        return Model(tuple((e, p) for e, p in self._effects if first <= e.stage <= last))

    def _view(self, side: str, inputs: EngineInputs, seen: Pictures) -> View:
        camera: dict[str, Any] = getattr(self._sensor.plan, side)
        left, right = (part.camera.camera_to_world for part in inputs.sides)
        own = right if side == "right" else left
        projector = inputs.projector
        return View(
            side=side,
            K=camera["k"],
            depth_m=seen["depth"][..., 0].astype(np.float64),
            normal=seen["normal"].astype(np.float64) @ own[:3, :3],
            pattern=np.zeros((1, 1), np.float32) if inputs.pattern is None else inputs.pattern,
            projector_K=np.eye(3) if projector is None else projector.k,
            camera_to_projector=np.eye(4)
            if projector is None
            else np.linalg.inv(self._sensor.projector_to_world) @ own,
            left_to_camera=np.linalg.inv(own) @ left,
            frame=replace(inputs.frame, id=self._sensor.frame_index),
            max_dn=inputs.max_dn,
            seed=inputs.seed,
            distortion=camera["distortion"],
            baseline_m=float(np.linalg.norm((np.linalg.inv(right) @ left)[:3, 3])),
            material=seen["material_id"][..., 0],
        )


def _light(seen: Pictures, power: float, ambient: float) -> Light:
    """Returns one camera's light, scaled to a projector of 1 W/sr and an ambient radiance of 1 W/(sr m^2). seen:
    kuafu's images, rendered with `power` and `ambient` in these units. Light.flat is the projector's direct light on
    Lambertian surfaces."""
    picture = {name: image[..., 0].astype(np.float64) for name, image in seen.items()}
    room = picture["ambient"] / ambient
    if power == 0.0:
        dark = np.zeros_like(room)
        return Light(dark, dark, room, dark)
    flat = picture["albedo"] / np.pi * picture["projector_visibility"] * picture["projector_geometry"]
    return Light(picture["projector_direct"] / power, picture["projector_indirect"] / power, room, flat)
