# SPDX-License-Identifier: Apache-2.0
"""Bias of disparity by the fraction of a pixel, of a D415's ASIC, the presets, the profiles and OpenCV.

    PYTHONPATH=build/python python3 tests/bench/bench_subpixel.py [--recordings FOLDER] [--part held-out] [--out DIR]

A matcher that is pulled to whole pixels errs by a curve of the disparity's fraction. Recorded: FOLDER is that of
bench_asic.py; the true fraction is the laser's, the curve the mean over the views of the median error where the truth
is smooth. Rendered: walls whose texture is the dots alone, before each preset at three scales: from the front at ten
distances (the error of the median, its mean over pictures of other noise: 16 at a quarter of the size, so that all
scales have the same number of pixels), and slanted and curved ones (the curve of the mean error).
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
DISTANCES_M = (0.5, 0.7, 1.0, 1.3, 1.6, 2.0, 2.1, 2.2, 2.6, 3.0)
SCALES = (1.0, 0.5, 0.25)
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


def wall(distance_m: float, turned_rad: float, curved: float) -> kuafu.Scene:
    """A surface of albedo 0.5, in SAPIEN's axes; curved: height of its waves over the distance."""
    scene = kuafu.Scene(kuafu.Device())
    side = 96 if curved else 2
    y, z = np.meshgrid(*2 * [np.linspace(-1.6, 1.6, side) * distance_m], indexing="ij")
    x = distance_m + np.tan(turned_rad) * y + curved * distance_m * np.cos(4 * y / distance_m)
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([first, first + a, first + b], 1) for a, b in ((1, side + 1), (side + 1, side))])
    material = scene.add_material(kuafu.Material(base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0))
    scene.add_instance(scene.add_mesh(np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), faces), [material])
    scene.set_environment((RADIANCE,) * 3)
    return scene


def _rendered(config: StereoDepthSensorConfig, scene: kuafu.Scene) -> tuple[Map, Map]:
    """Measured and true disparity, NaN = none, without the columns that the right camera does not see."""
    sensor = StereoDepthSensor(config, scene)
    sensor.take_picture(infrared_only=True)
    sensor.compute_depth()
    found, depth = np.array(sensor.get_disparity()), sensor.get_picture("depth", camera="left")[..., 0]
    with np.errstate(divide="ignore"):
        truth = np.where(depth > 0, config.focal_baseline_px_m / depth, np.nan).astype(np.float32)
    left = int(np.nanmax(truth)) + BORDER_PX
    inside = np.s_[BORDER_PX:-BORDER_PX, left:-BORDER_PX]
    return np.where(found > 0, found, np.nan)[inside].astype(np.float32), truth[inside]


def rendered_rows(name: str, spp: int) -> dict[str, list[object]]:
    """By scale: worst error in percent to 2 and to 3 m, p-p of the curves of a slanted and a curved wall, px."""
    rows: dict[str, list[object]] = {}
    for scale in SCALES:
        config = StereoDepthSensorConfig(name)
        config = config.scaled(scale) if scale != 1 else config
        config.samples_per_pixel, config.max_bounces = spp, 0
        errors = {}
        for distance in DISTANCES_M:
            scene, shares = wall(distance, 0.0, 0.0), []
            for seed in range(round(scale**-2)):
                config.noise_seed = config.render_seed = seed
                found, truth = _rendered(config, scene)
                shares.append(float(np.nanmedian(found - truth)) / float(np.median(truth)))
            errors[distance] = 100 * abs(1 / (1 + float(np.mean(shares))) - 1)
        row: list[object] = [round(max(e for d, e in errors.items() if d <= most), 2) for most in (2.0, 3.0)]
        for shape in ((0.6, 0.0), (0.0, 0.05)):
            found, truth = _rendered(config, wall(1.0, *shape))
            error = found - truth
            counts = abs(error) < 1
            curve = _curve(truth[counts] % 1, error[counts])
            row.append(round(float(np.nanmax(curve) - np.nanmin(curve)), 3))
        rows[f"{name}, scale {scale:g}"] = row
        print(f"| {name}, scale {scale:g} | {' | '.join(map(str, row))} |", flush=True)
    return rows


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
    parser.add_argument("--spp", type=int, default=4, help="samples per pixel (default: 4)")
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
    if args.walls:
        print("\n| | to 2 m, % | to 3 m, % | slanted px | curved px |\n|--|--|--|--|--|")
    for name in args.walls:
        rendered_rows(name, args.spp)


if __name__ == "__main__":
    main()
