# SPDX-License-Identifier: Apache-2.0
"""A real D435 pair through simsense, beside the device's own depth and OpenCV's StereoSGBM: one picture and a table.

    PYTHONPATH=build/python /usr/bin/python3 examples/real_pair/real_pair.py DATA/d435-real --out out/real_pair

DATA/d435-real holds left.png, right.png (848x480, 8 bit, rectified) and device_depth_mm.png (uint16 mm, 0 = none, every
second pixel of the left image)."""

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure

import simsense
from activestereo.common.output_files import replace_file

K = np.array([[427.12, 0, 426.93], [0, 427.12, 234.78], [0, 0, 1]])
BASELINE_M = 0.05
MAX_DISPARITY = 128


def simsense_depth_mm(left, right):
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -BASELINE_M
    sensor = simsense.DepthSensor(left.shape[::-1], K, K, left_to_right, rectified=True, max_disp=MAX_DISPARITY)
    return 1000.0 * sensor.compute(left, right)


def opencv_depth_mm(left, right):
    """StereoSGBM with the four paths and the checks that simsense uses; the left border that it cannot compute is
    padded, so both search everywhere."""
    block = 7
    matcher = cv2.StereoSGBM_create(
        0, MAX_DISPARITY, block, 8 * block**2, 32 * block**2, 1, 0, 15, 100, 1, cv2.STEREO_SGBM_MODE_HH4
    )
    padded = [cv2.copyMakeBorder(image, 0, 0, MAX_DISPARITY, 0, cv2.BORDER_REPLICATE) for image in (left, right)]
    disparity = matcher.compute(*padded)[:, MAX_DISPARITY:].astype(float) / 16.0
    return np.where(disparity > 0, 1000.0 * K[0, 0] * BASELINE_M / np.maximum(disparity, 1e-6), 0.0)


def against_device(depth_mm, device_mm):
    """(after one affine fit: depth_mm fitted, median |difference| mm; fill rate). The device's depth was decoded from a
    picture of unknown range."""
    both = (depth_mm > 0) & (device_mm > 0)
    fit = np.polyfit(depth_mm[both], device_mm[both], 1)
    fitted = np.where(depth_mm > 0, np.polyval(fit, depth_mm), 0.0)
    return fitted, float(np.median(np.abs(fitted - device_mm)[both])), float(np.mean(depth_mm > 0))


def draw(left, rows, device_mm):
    """One page: the left image and the device's depth on top, each engine's depth and its difference below."""
    figure = Figure(figsize=(12.5, 11.2), layout="constrained")
    axes = figure.subplots(len(rows) + 1, 2)
    span = np.percentile(device_mm[device_mm > 0], (1, 99))
    depth_style = {"cmap": "viridis_r", "vmin": span[0], "vmax": span[1]}
    axes[0, 0].imshow(left, cmap="gray")
    axes[0, 0].set_title("left infrared image of a D435")
    shown = axes[0, 1].imshow(np.ma.masked_equal(device_mm, 0), **depth_style)
    axes[0, 1].set_title(f"the device's own depth: {100 * np.mean(device_mm > 0):.1f} % measured")
    figure.colorbar(shown, ax=axes[0, 1], label="mm")
    for row, (name, fitted, median_mm, fill) in zip(axes[1:], rows, strict=True):
        shown = row[0].imshow(np.ma.masked_equal(fitted, 0), **depth_style)
        row[0].set_title(f"{name}: {100 * fill:.1f} % measured")
        figure.colorbar(shown, ax=row[0], label="mm")
        difference = np.ma.masked_where((fitted == 0) | (device_mm == 0), fitted - device_mm)
        shown = row[1].imshow(difference, cmap="RdBu_r", vmin=-15, vmax=15)
        row[1].set_title(f"minus the device's: median |difference| {median_mm:.2f} mm")
        figure.colorbar(shown, ax=row[1], label="mm")
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[], facecolor="#15181c")
    return figure


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="DATA/d435-real")
    parser.add_argument("--out", type=Path, default=Path("out/real_pair"))
    args = parser.parse_args()
    names = ("left", "right", "device_depth_mm")
    missing = [f"{name}.png" for name in names if not (args.data / f"{name}.png").is_file()]
    if missing:
        print(f"real_pair: {args.data} lacks {', '.join(missing)}", file=sys.stderr)
        return 2
    left, right, device_mm = (cv2.imread(str(args.data / f"{name}.png"), cv2.IMREAD_UNCHANGED) for name in names)
    rows = []
    for name, engine in (("simsense", simsense_depth_mm), ("OpenCV StereoSGBM (HH4, 7x7)", opencv_depth_mm)):
        rows.append((name, *against_device(engine(left, right)[::2, ::2], device_mm.astype(float))))
        print(
            f"{name:30s} median |difference| {rows[-1][2]:5.2f} mm   fill {100 * rows[-1][3]:5.1f} %   device "
            f"{100 * np.mean(device_mm > 0):.1f} %"
        )
    args.out.mkdir(parents=True, exist_ok=True)
    replace_file(
        args.out / "real_pair.png", lambda file: draw(left, rows, device_mm).savefig(file, format="png", dpi=100)
    )
    print(f"written: {args.out / 'real_pair.png'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
