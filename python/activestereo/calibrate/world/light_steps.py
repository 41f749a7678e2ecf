# SPDX-License-Identifier: Apache-2.0
"""The steps of `calibrate world` that measure light: exposures with black level and falloff, then the surfaces' albedo
and room light with the scene that carries them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.calibrate.world.light import LightEstimate, black_level, light_view, merged_textures, solve_light
from activestereo.calibrate.world.masks import known_masks
from activestereo.calibrate.world.mesh import write_scene
from activestereo.calibrate.world.pictures import albedo_picture, exposure_picture, known_picture
from activestereo.calibrate.world.state import World

_Z90 = 1.645
# Overlaps tell exposures no better than this, relative.
_LEAST_EXPOSURE = 0.005

Progress = Callable[[float], object] | None


def exposure_step(world: World, seed: int, folder: Path, progress: Progress) -> None:
    """Measures each frame's exposure, the black level and the lens's falloff by places that several views see."""
    views, poses = world.scene_views()
    train = _train(world)
    given = world.capture.rig.black_dn if "exposure" not in world.capture.measured else None
    believed = given or black_level([view for view in world.views if view.frame.split == "train"])
    lights = [light_view(view, world.K, world.projected()) for view in views]
    estimate = solve_light([lights[k] for k in train], [poses[k] for k in train], world.K, believed)
    if given is not None:
        estimate = replace(estimate, black_dn=given)
    exposure, deviation = (
        dict(zip(train, values, strict=True)) for values in (estimate.exposure, estimate.exposure_deviation)
    )
    for k in (k for k in range(len(views)) if k not in exposure):
        both = solve_light([lights[train[0]], lights[k]], [poses[train[0]], poses[k]], world.K, believed, estimate)
        exposure[k], deviation[k] = float(both.exposure[1]), float(both.exposure_deviation[1])
    first = views[train[0]].frame.exposure_s
    times = {views[k].frame.id: first * e for k, e in exposure.items()}
    frames = tuple(replace(f, exposure_s=times.get(f.id, f.exposure_s)) for f in world.capture.frames)
    rig = replace(world.capture.rig, black_dn=estimate.black_dn)
    known = [sd / exposure[k] for k, sd in deviation.items() if np.isfinite(sd) and sd > 0]
    uncertainty = replace(world.capture.uncertainty, exposure=max(float(np.max(known, initial=0.0)), _LEAST_EXPOSURE))
    world.capture = replace(world.capture, frames=frames, rig=rig, uncertainty=uncertainty)
    values = {
        "black_dn": list(estimate.black_dn),
        "exposure_s": {str(frame): time for frame, time in times.items()},
        "relative_deviation": {
            str(views[k].frame.id): float(sd / exposure[k]) if np.isfinite(sd) else None for k, sd in deviation.items()
        },
        "vignetting_exponent": None if estimate.exponent is None else list(estimate.exponent),
        "log_scatter": list(estimate.scatter) if np.isfinite(estimate.scatter[0]) else None,
    }
    world.note("exposure", values, _exposure_line(estimate, times, first))
    if len(train) > 1:
        own = [views[k] for k in train]
        world.pictures["exposure"] = exposure_picture(own, [poses[k] for k in train], world.K, estimate)


def _exposure_line(estimate: LightEstimate, times: dict[int, float], first: float) -> str:
    shares = ", ".join(f"{frame}: {time / first:.3f}" for frame, time in times.items())
    black = f"black level {estimate.black_dn[0]:.2f} +- {_Z90 * estimate.black_dn[1]:.2f} DN"
    if estimate.exponent is None:
        return f"exposure: {shares}; {black}; no overlaps: the lens's falloff cannot be told from the surfaces"
    n, sd = estimate.exponent
    return (
        f"exposure: {shares}; {black}; in overlaps light falls as cos^{n:.2f} +- {_Z90 * sd:.2f} of the angle (90 %): "
        f"log-ratios scatter by {estimate.scatter[0]:.3f} without, {estimate.scatter[1]:.3f} with"
    )


def albedo_step(world: World, seed: int, folder: Path, progress: Progress) -> None:
    """Makes the scene: each view's surface under its albedo and the room's light, without exposure and falloff."""
    views, poses = world.scene_views()
    train, measured = _train(world), world.capture.measured.get("exposure", {})
    exponent = measured.get("vignetting_exponent")
    times = {frame.id: frame.exposure_s for frame in world.capture.frames}
    own = [views[k] for k in train]
    relative = np.array([times[view.frame.id] for view in own])
    estimate = LightEstimate(
        relative / relative[0], np.zeros(len(own)), world.capture.rig.black_dn or black_level(own),
        None if exponent is None else (float(exponent[0]), float(exponent[1])), (np.nan, np.nan),
    )  # fmt: skip
    lights = [light_view(view, world.K, world.projected()) for view in own]
    textures = []
    for done in range(len(train)):
        textures.append(merged_textures(done, lights, [poses[j] for j in train], estimate, world.K))
        if progress:
            progress((done + 1) / len(train) * 0.7)
    scene = folder / "scene.glb"
    triangles = write_scene(scene, own, [poses[k] for k in train], textures, world.capture.rig.left)
    world.capture = replace(world.capture, scene_path=scene)
    world.masks = known_masks(views, poses, [k in train for k in range(len(views))], world.capture.rig)
    world.pictures |= {"albedo": albedo_picture(textures), "known": known_picture(views, world.masks)}
    share = float(np.mean([mask.mean() for mask in world.masks.values()]))
    spread = np.concatenate([t.deviation[np.isfinite(t.deviation)][::37] for t in textures])
    deviation = float(np.median(spread)) if spread.size else None
    values: dict[str, Any] = {"room_relative_deviation": deviation, "known_share": share}
    line = f"albedo: {triangles} triangles under albedo and room light; predicted by other views in {100 * share:.0f} %"
    if deviation is not None:
        line += f" of the images, where views differ by {100 * deviation:.1f} % in the median"
    world.note("albedo", values, line)


def _train(world: World) -> list[int]:
    """Indices of the scene's views that are not held out."""
    views, _ = world.scene_views()
    split = {frame.id: frame.split for frame in world.capture.frames}
    train = [k for k, view in enumerate(views) if split[view.frame.id] == "train"]
    if not train:
        raise ValueError(f"{world.where}: every view of the scene is held out: leave some to measure its light on")
    return train
