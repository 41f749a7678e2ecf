# SPDX-License-Identifier: Apache-2.0
"""Makes effects of functions that change engine fields, and computes images under the changed fields.

    @engine_effect(moves=("optics.vignetting_exponent",), stage=Stage.OPTICS, ...)
    def vignetting(inputs: EngineInputs, exponent: float) -> None:
        for side in inputs.sides:
            side.optics.vignetting_exponent += exponent

The engines simulate the effect from the changed fields. Without a render, each kind of field has a computation of its
own that changes the image: a moved camera warps it, a changed projector redraws its dots, added lights add light, air
and materials change the light, optics blur and dim it, and simsense's imager converts it to DN.

A camera's rotation displaces pixels independently of depth; the displacement by a translation depends on depth. If a
rig moves during the exposure, the scene is displaced in the image, but the rig's own dots hardly."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import wraps
from typing import Any

import numpy as np

import kuafu
import simsense
from activestereo.capture.capture import Frame
from activestereo.common.lens import distort, lens_fields, to_pixels, to_tangents
from activestereo.common.pose import motion_of_twist
from activestereo.effects.core.descriptor import Effect, effect
from activestereo.effects.core.dots import DotView, through_medium
from activestereo.effects.core.engine import EngineCamera, EngineInputs, PatternGain
from activestereo.effects.core.lamp import radiance_under
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import interpolated
from activestereo.effects.core.shading import dot_products, reflected
from activestereo.effects.core.surfaces import on_surfaces
from activestereo.effects.core.view import REFERENCE_TEMPERATURE_C, PickedView, View, drawn_by, transform

_ITERATIONS = 3


def displaced(light: Light, view: View, dt_s: float | np.ndarray) -> Light:
    """Returns the Light at time mid-exposure + dt_s: a number, or one per row [height] for row-wise readout.

    Each pixel takes the scene's light from the position of its surface point at mid-exposure. The dots stay with the
    rig: the pixel's new depth places them, and the new distance and angle to the projector scale them. New occlusions
    and shadows are ignored, since motions are of a few pixels.
    """
    rows = np.broadcast_to(np.asarray(dt_s, dtype=np.float64), view.shape[:1])
    if not view.frame.is_moving or not rows.any():
        return light
    # 1. The rig's motion: from camera coordinates at each row's time to those at mid-exposure, [height][4][4].
    twist, to_left = view.frame.camera_velocity, np.linalg.inv(view.left_to_camera)
    times, index = np.unique(rows, return_inverse=True)
    then_to_mid = np.stack([view.left_to_camera @ motion_of_twist(t * twist) @ to_left for t in times])[index]
    u, v, then, mid = _source_pixels(view, then_to_mid)
    moved = light.warped(u, v)
    # 2. The projector's irradiance on each surface point at the row's time, over that at mid-exposure.
    source = np.linalg.inv(view.camera_to_projector)[:3, 3]
    normal_mid = np.moveaxis(interpolated(np.moveaxis(view.normal, -1, 0), u, v), 0, -1)
    normal_then = normal_mid @ then_to_mid[:, :3, :3]
    after, before = (
        np.maximum(dot_products(normal, source - points), 0.0) / np.linalg.norm(source - points, axis=-1) ** 3
        for points, normal in ((then, normal_then), (mid, normal_mid))
    )
    safe = before > 0
    flat = moved.flat * np.where(safe, np.clip(after / np.where(safe, before, 1.0), 0.0, 4.0), 1.0)
    # 3. The dots at the pixel's new depth.
    dots = DotView.of(view)
    nominal = dots.nominal()
    now = dots.mean(view.pattern, *dots.project(transform(view.camera_to_projector, then)))
    lit = dots.lit & (light.flat > 0)
    seen = np.where(lit, light.direct / np.where(lit, light.flat, 1.0), nominal)
    direct = np.maximum(flat * (seen + now - nominal), 0.0)
    return replace(moved, direct=direct, flat=flat)


def _source_pixels(view: View, then_to_mid: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Returns (u, v, then, mid) of each pixel's surface point. u, v: its pixel position at mid-exposure. then, mid: its
    camera coordinates [height][width][3] at the row's time and at mid-exposure. then_to_mid: [height][4][4]."""
    rotation, shift = then_to_mid[:, :3, :3], then_to_mid[:, None, :3, 3]
    far = view.depth_m.max() if view.depth_m.any() else 1.0
    depth_mid = np.where(view.depth_m > 0, view.depth_m, 100.0 * far)  # at such a depth only turns show
    depth = depth_mid
    for _ in range(_ITERATIONS):
        then = view.points(depth)
        mid = then @ np.swapaxes(rotation, -1, -2) + shift
        u, v = view.to_pixels(mid[..., 0] / mid[..., 2], mid[..., 1] / mid[..., 2])
        depth_there = interpolated(depth_mid, u, v)
        depth = depth * depth_there / mid[..., 2]
    return u, v, then, mid


# An exposure is the mean of this many instants; discs of confusion are limited to this diameter.
_INSTANTS, _LARGEST_DISC_PX = 5, 40.0
# Engine fields that change images of moving frames alone.
_TIMES = ("delay_s", "exposure_s", "shutter", "line_time_s", "readout")


@dataclass
class _ViewInputs(EngineInputs):
    """EngineInputs for the images of one view. Both cameras stand at the origin of the view's frame, in which the rig's
    lights are given. One matt material represents all `chosen` surfaces. Gains and a blur of the pattern are stored
    here and applied later to the view's pixels."""

    chosen: float = 0.0
    gains: list[PatternGain] = field(default_factory=list)
    blur_px: float = 0.0

    @classmethod
    def of(cls, view: View, signal: dict[str, float]) -> _ViewInputs:
        whole = view.whole if isinstance(view, PickedView) else view
        height, width = whole.shape
        lens = lens_fields(view.distortion)
        cameras = (kuafu.Camera(width, height, view.K, np.eye(4), **lens) for _ in ("left", "right"))
        left, right = (EngineCamera(camera, kuafu.Optics(), dict(signal)) for camera in cameras)
        place = np.linalg.inv(view.camera_to_projector)
        projector = kuafu.Light(kind="projector", k=view.projector_K, ir_intensity=1.0, light_to_world=place)
        return cls(
            left, right, projector, view.pattern, view.frame,
            scene_materials=lambda number: kuafu.Material(specular=0.0), material_count=1,
            bounds_m=((-1.0,) * 3, (1.0,) * 3), max_dn=view.max_dn, seed=view.seed,
        )  # fmt: skip

    def surfaces(self, chosen: float) -> Iterator[kuafu.Material]:
        self.chosen = chosen
        yield self.material(0)

    def dim_pattern(self, gain: PatternGain) -> None:
        self.gains.append(gain)

    def blur_pattern(self, sigma_px: float) -> None:
        self.blur_px = float(np.hypot(self.blur_px, sigma_px))


def frame_signal(frame: Frame) -> dict[str, float]:
    """Returns simsense's imager settings, {field: value}, of a noiseless imager with a frame's exposure, gain and
    temperature. The imager's input is counts per second at gain 1."""
    temperature_c = REFERENCE_TEMPERATURE_C if frame.temperature_c is None else frame.temperature_c
    own = {"exposure_s": frame.exposure_s, "gain": frame.gain, "temperature_c": temperature_c}
    return simsense.signal_preset("neutral") | own | {"dark_reference_c": REFERENCE_TEMPERATURE_C}


def _analogue(signal: dict[str, float], light: np.ndarray, view: View, unit: float | None = None) -> np.ndarray:
    """Returns simsense's imager output for radiance `light`, with noise and before rounding, in the view's DN. signal:
    simsense's imager parameters. unit: simsense's counts per DN; None = 255 over the view's full scale."""
    scale = 255.0 / view.max_dn if unit is None else unit
    in_counts = ("conversion_gain_dn_per_e", "black_level_dn", "black_level_dn_per_k")
    fine = signal | {name: signal[name] * scale for name in in_counts}
    counts = simsense.signal_analogue(fine, light, seed=view.seed, frame_index=view.frame.id, side=int(view.is_right))
    return np.asarray(counts / scale)


def tangents(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Returns the tangents of the angles from the projector's axis to each pixel's surface point, x and y,
    [height][width] each."""
    points = view.projector_points()
    z = np.where(points[..., 2] > 0, points[..., 2], np.inf)
    return points[..., 0] / z, points[..., 1] / z


# ---- the imager ----


def _counted(dn: np.ndarray, view: View, inputs: _ViewInputs) -> np.ndarray:
    """Returns an image in DN under the changed imager settings (simsense's signal), without rounding. dn:
    [height][width], with or without the black level, as the effect's stage says. Unchanged pixels stay the same to
    the bit."""
    nominal = frame_signal(view.frame)
    moved = inputs.sides[view.is_right].signal
    if moved == nominal:
        return dn
    light = dn / view.frame.exposure_gain
    return np.asarray(dn + (_analogue(moved, light, view) - _analogue(nominal, light, view)), dtype=np.float64)


def _speckled(light: Light, view: View, inputs: _ViewInputs) -> Light:
    """Returns the light with its projector part times simsense's speckle, where that is the laser's alone."""
    if not inputs.speckle_of_laser:
        return light
    pose = hashlib.sha256(np.ascontiguousarray(view.frame.camera_to_world).tobytes()).digest()
    signal = inputs.sides[view.is_right].signal | {"scene_index": int.from_bytes(pose[:4], "little")}
    return light.scale_projector(_analogue(signal, np.ones(view.shape), view, 1.0).astype(np.float64))


# ---- the lens ----


def _through_optics(value: Any, view: View, inputs: _ViewInputs) -> Any:
    """Returns a Light after the lens' point spread, or images [..., height, width] after its falloff and glare
    (kuafu_optics_desc). The view's own camera has none of these."""
    optics = inputs.sides[view.is_right].optics
    if isinstance(value, Light):
        sigma_px: float | np.ndarray = optics.psf_sigma_px
        if optics.psf_corner_sigma_px > 0.0:
            fx, fy = view.field()
            sigma_px = np.hypot(sigma_px, optics.psf_corner_sigma_px * (fx * fx + fy * fy) / 2.0)
        return value.blurred(sigma_px) if np.any(sigma_px) else value
    if optics.vignetting_exponent != 0.0:
        x, y = view.rays()
        value = value * (1.0 + x * x + y * y) ** (-optics.vignetting_exponent / 2.0)
    glare = optics.veiling_glare_fraction
    return value if glare == 0.0 else (1.0 - glare) * value + glare * value.mean(axis=(-2, -1), keepdims=True)


# ---- the camera ----


def _redrawn(light: Light, view: View, inputs: _ViewInputs) -> Light:
    """Returns the light as a camera at another pose, or behind another lens, sees it. New occlusions are ignored, since
    poses differ by a few pixels."""
    camera = inputs.sides[view.is_right].camera
    to_nominal = camera.camera_to_world
    if to_nominal[:3, 3].any():
        light = light.warped(*_source_pixels(view, np.broadcast_to(to_nominal, (view.shape[0], 4, 4)))[:2])
    elif (to_nominal[:3, :3] != np.eye(3)).any():
        rx, ry = view.rays()
        ray = np.stack([rx, ry, np.ones_like(rx)], axis=-1) @ to_nominal[:3, :3].T
        light = light.warped(*view.to_pixels(ray[..., 0] / ray[..., 2], ray[..., 1] / ray[..., 2]))
    lens = tuple(camera.distortion)[: len(view.distortion)]
    if lens == tuple(view.distortion) and (camera.k == view.K).all():
        return light
    own, other = (tuple(k.ravel().tolist()) for k in (view.K, camera.k))
    return light.warped(*drawn_by(view.shape, own, view.distortion, other, lens))


def _average_exposure(light: Light, view: View, inputs: _ViewInputs) -> Light:
    """Returns the mean light over the exposure of a moving frame, where each row is exposed at its own time."""
    side, height = inputs.sides[view.is_right], view.shape[0]
    camera, rows_s = side.camera, np.zeros(height)
    if camera.shutter == "rolling":
        down = 1.0 if camera.readout == "rows_down" else -1.0
        rows_s = down * camera.line_time_s * (np.arange(height) - (height - 1) / 2)
    shares = (np.arange(_INSTANTS) + 0.5) / _INSTANTS - 0.5 if camera.exposure_s else np.zeros(1)
    seen = [displaced(light, view, side.delay_s + camera.exposure_s * share + rows_s) for share in shares]
    return seen[0] if len(seen) == 1 else Light.of_images(np.mean([s.images for s in seen], axis=0))


# ---- the projector ----


def _projected(light: Light, view: View, inputs: _ViewInputs) -> Light:
    """Returns the light under the changed projector. The surfaces' reflection and shadows stay."""
    own = inputs.projector
    assert own is not None
    for gain in inputs.gains:
        light = light.scale_projector(gain(*tangents(view)))
    if own.ir_intensity is not None and own.ir_intensity != 1.0:
        light = light.scale_projector(own.ir_intensity)
    if inputs.blur_px > 0.0:
        seen = light.blurred(inputs.blur_px)
        light = replace(light, direct=seen.direct, flat=seen.flat)
    if inputs.pattern is not None and inputs.pattern is not view.pattern:
        dots = DotView.of(view)
        light = dots.change(light, dots.mean(inputs.pattern))
    if own.pattern_scale != 1.0 or any(own.distortion):
        dots, K = DotView.of(view), view.projector_K
        x, y = distort(*to_tangents(dots.u, dots.v, K), own.distortion)
        u, v = to_pixels(x / own.pattern_scale, y / own.pattern_scale, K)  # of the beam that lights the pixel now
        light = dots.change(light, dots.mean(view.pattern, u, v))
    if own.radius_m > 0.0:
        dots = DotView.of(view)
        z = np.where(dots.lit, dots.z, own.focus_m)
        aperture_px_m = own.radius_m * np.mean(np.diag(view.projector_K)[:2])
        disc_px = np.minimum(2.0 * aperture_px_m * np.abs(1.0 / z - 1.0 / own.focus_m), _LARGEST_DISC_PX)
        light = dots.change(light, dots.mean_of_discs(view.pattern, disc_px))
    return light


# ---- the scene ----


def _add_lights(light: Light, view: View, inputs: _ViewInputs) -> Light:
    """Returns the light plus the light of projectors and lamps that an effect adds. It counts as ambient, because
    it does not depend on the rig's projector. Added projectors cast no shadows."""
    world_to_camera = view.left_to_camera @ np.linalg.inv(view.frame.camera_to_world)
    poses = [(added, added.light_to_world) for added in inputs.rig_lights]
    poses += [(added, world_to_camera @ added.light_to_world) for added in inputs.lights]
    for added, to_camera in poses:
        light = replace(light, ambient=light.ambient + radiance_under(added, to_camera, light, view))
    return light


def _reflected(light: Light, view: View, inputs: _ViewInputs) -> Light:
    """Returns the light with changed materials on the chosen surfaces."""
    changed = reflected(light, view, inputs.material(0), inputs.unrendered)
    return light if changed is light else on_surfaces(light, changed, view, inputs.chosen)


# The computation of an image, by the beginning of an engine field's name; the first that fits counts.
_IMAGES: dict[str, Callable[[Any, View, _ViewInputs], Any]] = {
    "signal.speckle": _speckled,
    "signal.": _counted,
    "optics.": _through_optics,
    "projector.": _projected,
    "pattern": _projected,
    "lights": _add_lights,
    "rig_lights": _add_lights,
    "medium": lambda light, view, now: light if now.medium is None else through_medium(light, view, now.medium),
    "materials.": _reflected,
}


def engine_effect(
    id: str = "", *, moves: tuple[str, ...], **descriptor: Any
) -> Callable[[Callable[..., None]], Effect]:
    """Returns a decorator that makes an Effect of a function of EngineInputs and the parameters. moves: names of the
    engine fields that the function changes, which select the computation of the image; a test compares them with the
    actual changes. The function's docstring becomes the summary. descriptor: further fields of Effect."""
    names = [name.removeprefix("right.").removeprefix("left.") for name in moves]
    only_times = all(name.removeprefix("camera.") in _TIMES for name in names)
    of_camera = _average_exposure if only_times else _redrawn
    acts = next((act for kind, act in _IMAGES.items() if any(n.startswith(kind) for n in names)), of_camera)

    def make(move: Callable[..., None]) -> Effect:
        @wraps(move, assigned=("__name__", "__doc__"))  # and __wrapped__, where effect() finds the parameters
        def image(value: Any, view: View, **values: float) -> Any:
            # Only the imager's effects may ask for a frame's exposure: frames that differ in it share the other images.
            if only_times and not view.frame.is_moving:
                return value
            signal = frame_signal(view.frame) if acts is _counted else simsense.signal_preset("neutral")
            inputs = _ViewInputs.of(view, signal)
            move(inputs, **values)
            return acts(value, view, inputs)

        return effect(id, engine=move, engine_fields=moves, **descriptor)(image)

    return make
