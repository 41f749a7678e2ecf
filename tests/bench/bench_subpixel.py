# SPDX-License-Identifier: Apache-2.0
"""Bias of disparity by the fraction of a pixel, of a D415's ASIC, the presets, the profiles and OpenCV.

    PYTHONPATH=build/python python3 tests/bench/bench_subpixel.py [--recordings FOLDER] [--part held-out] [--out DIR]
    PYTHONPATH=build/python python3 tests/bench/bench_subpixel.py --worst

A matcher that is pulled to whole pixels errs by a curve of the disparity's fraction. Recorded: FOLDER is that of
bench_asic.py; the true fraction is the laser's, the curve the mean over the views of the median error where the truth
is smooth. Rendered: strips of walls from 0.3 to 4 m, or from where the preset's range of disparities begins, whose
texture is the dots alone. Frontal walls are turned by up to 4 degrees, slanted ones by 11 to 40, curved ones are wavy
and turned by up to 29. Each picture has another distance, shape and noise, so that a bin sees all parts of the pattern;
the curve is the mean error below half a pixel. noise: the largest peak to peak that the same pictures show when each
one's curve is turned by a random fraction. error: RMS of the frontal walls' median errors. --worst: frontal walls at
each of DISTANCES_M, every one with many draws of the imagers' noise; the largest mean of a distance's median errors,
with that mean's standard error.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import cv2
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from bench_asic import PARTS, Map, View, figures, matcher
from bench_pairs import HH4, sgbm
from numpy.typing import NDArray

import kuafu
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.camera.plan import matcher_parameters
from activestereo.cli.depth import PROFILES

BINS, LEAST_PIXELS = 20, 200
SMOOTH_PX, SMOOTH_SIDE = 3.0, 15
RADIANCE = 0.05
NEAR_M, FAR_M = 0.3, 4.0
ROWS = 96
SCALES = {1.0: (4, 30), 0.5: (8, 24), 0.25: (16, 48)}  # samples per pixel, walls of each shape
WALL_BINS, TURNS = 10, 200
DISTANCES_M = (0.5, 0.7, 1.0, 1.4, 1.7, 2.0, 2.5, 3.0)
DRAWN = {1.0: (12, 8), 0.5: (12, 32), 0.25: (12, 128)}  # walls of a distance, draws of the noise of a wall
BORDER_PX = 12


def _smooth(truth: Map) -> NDArray[np.bool_]:
    kernel = np.ones((SMOOTH_SIDE, SMOOTH_SIDE), np.uint8)
    known = np.isfinite(truth)
    most = cv2.dilate(np.where(known, truth, 0), kernel)
    least = cv2.erode(np.where(known, truth, 1e4).astype(np.float32), kernel)
    return (cv2.erode(known.astype(np.uint8), kernel) > 0) & (most - least < SMOOTH_PX)


def _curve(fraction: NDArray[np.float32], error: NDArray[np.float32]) -> NDArray[np.float64]:
    place = (fraction * BINS).astype(int)
    parts = [error[place == k] for k in range(BINS)]
    return np.array([np.median(part) if len(part) > LEAST_PIXELS else np.nan for part in parts])


def recorded_curve(views: list[View], found: list[Map]) -> NDArray[np.float64]:
    curves = []
    for view, disparity in zip(views, found, strict=True):
        error = disparity - view.truth
        counts = view.is_visible & _smooth(view.truth) & np.isfinite(view.device) & (abs(error) < 1)
        curves.append(_curve(view.truth[counts] % 1, error[counts] - np.median(error[counts])))
    return np.nanmean(curves, axis=0)


def wall(shape: str, distance_m: float, random: np.random.Generator) -> kuafu.Scene:
    """A surface of albedo 0.5, in SAPIEN's axes."""
    least, most = {"frontal": (-0.07, 0.07), "slanted": (0.2, 0.7), "curved": (-0.5, 0.5)}[shape]
    slope = np.tan(random.uniform(least, most)) * random.choice((-1, 1))
    height, phase = 0.05 * distance_m * (shape == "curved"), random.uniform(0, 2 * np.pi)
    y, z = np.meshgrid(np.linspace(-3, 3, 400) * distance_m, [-3 * distance_m, 3 * distance_m], indexing="ij")
    x = distance_m + slope * y + height * np.cos(4 * y / distance_m + phase)
    first = np.arange(0, 2 * len(y) - 2, 2)
    faces = np.concatenate([np.stack([first, first + a, first + b], 1) for a, b in ((2, 3), (3, 1))])
    scene = kuafu.Scene(kuafu.Device())
    material = scene.add_material(kuafu.Material(base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0))
    scene.add_instance(scene.add_mesh(np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), faces), [material])
    scene.set_environment((RADIANCE,) * 3)
    return scene


def _strip(name: str, scale: float) -> StereoDepthSensorConfig:
    """The preset, and only the middle rows of its pictures."""
    config = StereoDepthSensorConfig(name)
    config = config.scaled(scale) if scale != 1 else config
    return config.resized(config.ir_resolution[0], ROWS)


def _pictured(config: StereoDepthSensorConfig, scene: kuafu.Scene) -> StereoDepthSensor:
    sensor = StereoDepthSensor(config, scene)
    sensor.take_picture(infrared_only=True)
    return sensor


def _measured(sensor: StereoDepthSensor) -> tuple[Map, Map]:
    """Measured and true disparity, NaN = none, without the columns that the right camera does not see."""
    config = sensor.get_config()
    sensor.compute_depth()
    found, depth = np.array(sensor.get_disparity()), sensor.get_picture("depth", camera="left")[..., 0]
    with np.errstate(divide="ignore"):
        truth = np.where(depth > 0, config.focal_baseline_px_m / depth, np.nan).astype(np.float32)
    left = int(np.nanmax(truth)) + BORDER_PX
    inside = np.s_[BORDER_PX:-BORDER_PX, left:-BORDER_PX]
    return np.where(found > 0, found, np.nan)[inside].astype(np.float32), truth[inside]


def _peak_to_peak(sums: NDArray[np.float64]) -> float:
    """Range of the curve that pictures' sums make; sums: [pictures][errors, pixels][bin]."""
    errors, pixels = sums.sum(axis=0)
    return float(np.ptp(errors / pixels))


def _of_noise(sums: NDArray[np.float64], random: np.random.Generator) -> float:
    turned = []
    for _ in range(TURNS):
        by = random.integers(0, WALL_BINS, (len(sums), 1, 1))
        place = np.broadcast_to((np.arange(WALL_BINS) + by) % WALL_BINS, sums.shape)
        turned.append(_peak_to_peak(np.take_along_axis(sums, place, axis=2)))
    return float(np.mean(turned))


def rendered_rows(name: str) -> dict[str, list[float]]:
    """By scale: p-p of the curves of frontal, slanted, curved walls and of noise, px; error in % to 2 and to 3 m."""
    rows: dict[str, list[float]] = {}
    for scale, (spp, count) in SCALES.items():
        config, errors = _strip(name, scale), []
        config.samples_per_pixel, config.max_bounces = spp, 0
        near_m = max(NEAR_M, 1.08 * config.focal_baseline_px_m / config.max_disparity)
        row, noise = [], []
        for kind, shape in enumerate(("frontal", "slanted", "curved")):
            sums = np.zeros((count, 2, WALL_BINS))
            for k in range(count):
                random = np.random.default_rng([kind, k])
                distance_m = near_m * (FAR_M / near_m) ** ((k + random.uniform()) / count)
                config.noise_seed = config.render_seed = count * kind + k
                found, truth = _measured(_pictured(config, wall(shape, distance_m, random)))
                error = found - truth
                counts = abs(error) < 0.5
                place = (truth[counts] % 1 * WALL_BINS).astype(int) % WALL_BINS
                sums[k] = [np.bincount(place, weights, WALL_BINS) for weights in (error[counts], None)]
                if shape == "frontal":
                    errors.append((distance_m, 100 * float(np.nanmedian(error / truth))))
            row.append(round(_peak_to_peak(sums), 3))
            noise.append(_of_noise(sums, np.random.default_rng(kind)))
        row.append(round(max(noise), 3))
        row += [round(float(np.sqrt(np.mean([e**2 for d, e in errors if d <= most]))), 2) for most in (2.0, 3.0)]
        rows[f"{name}, scale {scale:g}"] = row
        print(f"| {name}, scale {scale:g} | {' | '.join(map(str, row))} |", flush=True)
    return rows


def _mean_errors(sensor: StereoDepthSensor, draws: int) -> float:
    """Mean over draws of the noise of the median error, percent."""
    errors = []
    for _ in range(draws):
        sensor.change(noise_seed=sensor.get_config().noise_seed + 1)
        found, truth = _measured(sensor)
        errors.append(100 * np.nanmedian((found - truth) / truth))
    return float(np.mean(errors))


def worst_row(name: str, scale: float) -> list[float]:
    """Worst systematic error of frontal walls to 2 m and its standard error, then both to 3 m, percent."""
    config, by_distance = _strip(name, scale), []
    walls, draws = DRAWN[scale]
    config.samples_per_pixel, config.max_bounces = SCALES[scale][0], 0
    for place, distance_m in enumerate(DISTANCES_M):
        errors = []
        for k in range(walls):
            config.render_seed = walls * place + k
            config.noise_seed = draws * config.render_seed
            scene = wall("frontal", distance_m, np.random.default_rng([3, place, k]))
            errors.append(_mean_errors(_pictured(config, scene), draws))
        by_distance.append((distance_m, np.mean(errors), np.std(errors, ddof=1) / np.sqrt(walls)))
    row = []
    for most_m in (2.0, 3.0):
        worst = max((one for one in by_distance if one[0] <= most_m), key=lambda one: abs(one[1]))
        row += [round(abs(float(worst[1])), 3), round(float(worst[2]), 3)]
    print(f"| {name}, scale {scale:g} | {' | '.join(map(str, row))} |", flush=True)
    return row


def _recorded_matchers() -> dict[str, Callable[[View], Map]]:
    hh4 = sgbm(HH4, 7)
    presets = {f"preset {n}": matcher(matcher_parameters(StereoDepthSensorConfig(n))) for n in ("D415", "D435")}
    summed = matcher(matcher_parameters(StereoDepthSensorConfig("D415")) | {"subpixel": "equiangular_summed"})
    return {
        "ASIC": lambda view: view.device,
        **presets,
        "preset D415, summed": summed,
        "profile active": matcher(dict(PROFILES["active"])),
        "engine's default": matcher({}),
        "OpenCV HH4": lambda view: hh4(view.left, view.right, 128),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=Path)
    parser.add_argument("--part", choices=PARTS, default="held-out")
    parser.add_argument("--walls", nargs="*", default=["D415", "D435"], help="presets (default: D415 D435)")
    parser.add_argument("--worst", action="store_true", help="the walls' worst systematic errors instead of curves")
    parser.add_argument("--out", type=Path, default=Path("."), help="folder for subpixel.png")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    if args.recordings is not None:
        views = [View.read(args.recordings / f"index_{name}") for name in PARTS[args.part]]
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        print(f"{args.part}, {len(views)} views\n\n| | p-p px | plane px |\n|--|--|--|")
        for name, match in _recorded_matchers().items():
            found = [match(view) for view in views]
            curve = recorded_curve(views, found)
            print(f"| {name} | {np.ptp(curve):.3f} | {figures(views, found)[4]:.3f} |", flush=True)
            axes.plot((np.arange(BINS) + 0.5) / BINS, curve, label=f"{name}, {np.ptp(curve):.3f} px")
        axes.set(xlabel="fraction of the true disparity, px", ylabel="median error, px", xlim=(0, 1))
        axes.legend(fontsize=8)
        figure.savefig(args.out / "subpixel.png", dpi=110)
    if args.worst:
        print("| | to 2 m, % | standard error | to 3 m, % | standard error |\n|--|--|--|--|--|")
        for name in args.walls:
            for scale in SCALES:
                worst_row(name, scale)
        return
    if args.walls:
        print("\n| | frontal px | slanted px | curved px | noise px | to 2 m, % | to 3 m, % |\n|--|--|--|--|--|--|--|")
    for name in args.walls:
        rendered_rows(name)


if __name__ == "__main__":
    main()
