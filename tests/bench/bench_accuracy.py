# SPDX-License-Identifier: Apache-2.0
"""How accurate the matcher is, beside the published SimSense's arithmetic and OpenCV's StereoSGBM, on pairs whose
disparity is known, and on a real pair beside the device's own depth. Prints tables; draws the bias against the fraction
of a pixel, and what is wrong where.

    PYTHONPATH=build/python python3 tests/bench/bench_accuracy.py [--out tests/bench] [--no-render]
"""

import argparse
import io
import os
from pathlib import Path

import cv2
import numpy as np
from bench_pairs import HH4, THREE_WAY, ours, seen_by_both, sgbm
from matplotlib.figure import Figure
from PIL import Image
from scipy.ndimage import gaussian_filter, map_coordinates

import simsense

DISPARITIES = 128
INSIDE = np.s_[12:-12, 12:-12]
PUBLISHED_PENALTIES = {"p1": 7, "p2": 86}  # of SimSense
DATA = Path(os.environ.get("ACTIVESTEREO_DATA", Path(__file__).parents[3] / "shared")) / "data" / "d435-real"


EXACT = {"faults": simsense.FAULTS, "subpixel": 1, "census_contrast": 0}
MATCHERS = {
    "simsense, p1 7, p2 86": ours(**PUBLISHED_PENALTIES),
    "simsense, 8 paths": ours(path_count=8, **PUBLISHED_PENALTIES),
    "simsense, default (p1 8, p2 32)": ours(p1=8, p2=32),
    "simsense, fast (block 1x1, p1 8, p2 32)": ours(block_width=1, block_height=1, p1=8, p2=32),
    "simsense-exact (the published engine)": ours(**EXACT, **PUBLISHED_PENALTIES),
    "OpenCV StereoSGBM HH4, block 7": sgbm(HH4, 7),
    "OpenCV StereoSGBM 3WAY, block 7": sgbm(THREE_WAY, 7),
}


SHOWN = (
    "simsense, default (p1 8, p2 32)", "simsense, fast (block 1x1, p1 8, p2 32)",
    "simsense-exact (the published engine)", "OpenCV StereoSGBM HH4, block 7", "OpenCV StereoSGBM 3WAY, block 7",
)  # fmt: skip


def sloped_dots(width=960, height=540, noise_dn=2.0, seed=1):
    """(left, right, disparity): Gaussian dots on a slope through every fraction of a pixel, exact in both images."""
    random = np.random.default_rng(seed)
    fine, reach = 8, 140
    pattern = np.zeros((height, (width + reach) * fine))
    count = width * height // 28
    rows, columns = random.integers(0, height, count), random.integers(0, pattern.shape[1], count)
    np.add.at(pattern, (rows, columns), random.gamma(3.0, 1.0, count))
    pattern = gaussian_filter(pattern, (0.9, 0.9 * fine))
    pattern *= 60.0 / pattern.mean()
    y, x = np.mgrid[0:height, 0:width].astype(float)
    disparity = 25.0 + 0.045 * x + 0.021 * y
    at = lambda u: map_coordinates(pattern, [y, (u + reach - 1) * fine], order=3, mode="nearest")  # noqa: E731
    images = (at(x - disparity), at(x))
    counts = (
        np.clip(np.rint(15 + image + random.normal(0, noise_dn, image.shape)), 0, 255).astype(np.uint8)
        for image in images
    )
    return (*counts, disparity)


def rendered_table_top():
    """(left, right, disparity): the example scene as a D435 sees it; truth from the renderer, at pixel centres."""
    from activestereo import Pose, StereoDepthSensorConfig
    from bench_camera import before_table_top

    config = StereoDepthSensorConfig("sapien-D435")
    config.rgb_resolution, config.rgb_intrinsic = config.ir_resolution, config.ir_intrinsic
    config.trans_pose_l, config.trans_pose_r = Pose(), Pose([0, -0.05, 0])
    config.ir_signal, config.samples_per_pixel = "d435", 32
    sensor = before_table_top(config, 0.25, infrared_only=False)
    true = sensor.get_true_depth().astype(float)
    disparity = np.where(true > 0, config.focal_baseline_px_m / np.where(true > 0, true, 1), np.nan)
    return (*sensor.get_ir_measured(), disparity)


def table_of(left, right, truth):
    """Fill of what both cameras see, shares off by more and median error per matcher; returns {matcher: disparity}."""
    seen = np.zeros(truth.shape, bool)
    seen[INSIDE] = seen_by_both(truth)[INSIDE]
    all_found = {}
    print(f"| {'matcher':40} | fill | off > 0.5 px | > 2 px | median |\n|--|--|--|--|--|")
    for name, match in MATCHERS.items():
        found = all_found[name] = match(left, right, DISPARITIES)
        measured = (found > 0) & np.isfinite(truth)
        error = np.abs(found - truth)[measured]
        off = [100 * np.mean(error > limit) for limit in (0.5, 2)]
        fill = 100 * np.mean((found > 0)[seen])
        print(f"| {name:40} | {fill:.1f} % | {off[0]:.2f} % | {off[1]:.2f} % | {np.median(error):.3f} px |")
    return all_found


def draw(path, title, panels, columns=3):
    """panels: (title, image [height, width], matplotlib's settings)."""
    rows = -(-len(panels) // columns)
    height, width = panels[0][1].shape
    figure = Figure(figsize=(9.6, 0.45 + rows * (9.6 / columns * height / width + 0.2)), layout="constrained")
    figure.suptitle(title, fontsize=9)
    for axes, (name, image, settings) in zip(figure.subplots(rows, columns).flat, panels, strict=True):
        axes.imshow(image, interpolation="nearest", **settings)
        axes.set_title(name, fontsize=7)
        axes.set_axis_off()
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=90)
    Image.open(drawn).convert("RGB").quantize(96).save(path, optimize=True)  # a third of the bytes


def draw_errors(path, left, found, truth):
    """Signed disparity errors of some matchers beside the image."""
    from matplotlib import colormaps

    colours = colormaps["RdBu"].with_extremes(bad="black")
    panels = [("infrared left (display gamma 2)", np.sqrt(left), {"cmap": "gray"})]
    for name in SHOWN:
        error = np.where((found[name] > 0) & np.isfinite(truth), found[name] - truth, np.nan)
        panels.append((name, error, {"cmap": colours, "vmin": -1, "vmax": 1}))
    draw(path, "disparity error: -1 px red, 0 white, +1 px blue; black: no measurement, or no truth", panels)


def draw_depths(path, left, device_mm, found_mm):
    from matplotlib import colormaps

    colours = {"cmap": colormaps["turbo"].with_extremes(bad="black"), "vmin": 400, "vmax": 1100}
    shown = {"the device's own depth": device_mm} | found_mm
    panels = [(name, np.where(depth > 0, depth, np.nan), colours) for name, depth in shown.items()]
    draw(
        path,
        "depth of a real D435 pair, 0.4 m blue to 1.1 m red; black: no measurement",
        [("infrared left", left, {"cmap": "gray"}), *panels],
    )


def locking_curve(found, truth, bins=25):
    """Mean error over the fraction of the true disparity, and its amplitude: half of the peak-to-peak of the curve."""
    found, truth = found[INSIDE], truth[INSIDE]
    use = np.abs(found - truth) < 1
    fraction = np.floor((truth % 1) * bins).astype(int)[use]
    mean = np.bincount(fraction, (found - truth)[use], bins) / np.bincount(fraction, minlength=bins)
    mean -= mean.mean()
    return mean, np.ptp(mean) / 2


def pixel_locking(left, right, truth, folder):
    shown = {
        "equiangular on the block's costs (default)": ours(**PUBLISHED_PENALTIES),
        "parabola": ours(subpixel=1, **PUBLISHED_PENALTIES),
        "parabola, every count (published SimSense)": ours(subpixel=1, census_contrast=0, **PUBLISHED_PENALTIES),
        "OpenCV StereoSGBM HH4, block 7": sgbm(HH4, 7),
    }
    figure = Figure(figsize=(7.2, 3.8), layout="constrained")
    axes = figure.subplots()
    print("| subpixel step | pixel locking: amplitude of the bias |\n|--|--|")
    for name, match in shown.items():
        mean, amplitude = locking_curve(match(left, right, DISPARITIES), truth)
        print(f"| {name} | {amplitude:.4f} px |")
        axes.plot((np.arange(len(mean)) + 0.5) / len(mean), mean, label=f"{name}: {amplitude:.3f} px")
    axes.set_xlabel("fraction of the true disparity, pixels")
    axes.set_ylabel("mean error, pixels")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(folder / "pixel_locking.png", dpi=90)


def real_pair(folder):
    """Beside the depth that a D435 computed itself, after one affine fit: its scale was decoded from a picture."""
    if not DATA.is_dir():
        print(f"no real pair at {DATA}: set ACTIVESTEREO_DATA")
        return
    left, right, device = (
        cv2.imread(str(DATA / f"{name}.png"), cv2.IMREAD_UNCHANGED) for name in ("left", "right", "device_depth_mm")
    )
    print(
        f"| {'matcher':40} | median difference | within 2 % | fill (device {100 * np.mean(device > 0):.1f} %) "
        f"|\n|--|--|--|--|"
    )
    found_mm = {}
    for name, match in MATCHERS.items():
        disparity = match(left, right, DISPARITIES)[::2, ::2]
        depth = np.where(disparity > 0, 427.12 * 50 / np.where(disparity > 0, disparity, 1), 0)
        both = (depth > 150) & (depth < 2000) & (device > 0)
        fit = [1.0, 0.0]
        for limit in (100, 20, 20):  # the fit is to what agrees, so that a matcher's outliers do not bend it
            agree = both & (np.abs(np.polyval(fit, depth) - device) < limit)
            fit = np.polyfit(depth[agree], device[agree], 1)
        found_mm[name] = np.where(depth > 0, np.polyval(fit, depth), 0)
        both = (depth > 0) & (device > 0)
        difference = np.abs(np.polyval(fit, depth[both]) - device[both])
        near = 100 * np.mean(difference < 0.02 * device[both])
        print(f"| {name:40} | {np.median(difference):.2f} mm | {near:.1f} % | {100 * np.mean(depth > 0):.1f} % |")
    draw_depths(
        folder / "accuracy_real.png", left[::2, ::2], device, {name: found_mm[name] for name in SHOWN[:1] + SHOWN[2:]}
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("."), help="folder for the pictures")
    parser.add_argument(
        "--no-render", action="store_true", help="leave the rendered pair out (it needs kuafu and half a minute)"
    )
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    print("\nDots on a slope, 960x540, 25..80 px, 2 DN of noise")
    pixel_locking(*sloped_dots(), args.out)
    if not args.no_render:
        pair = rendered_table_top()
        print("\nTable top, rendered, D435 with its imager's noise, 848x480")
        draw_errors(args.out / "accuracy_rendered.png", pair[0], table_of(*pair), pair[2])
    print("\nReal D435 pair")
    real_pair(args.out)


if __name__ == "__main__":
    main()
