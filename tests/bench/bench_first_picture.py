# SPDX-License-Identifier: Apache-2.0
"""How the example scene's infrared picture stands beside a recording of a real D435: the dots' share of the light, and
the noise of the wall. Draws a crop of both, pixel by pixel.

    PYTHONPATH=build/python /usr/bin/python3 tests/bench/bench_first_picture.py [DATA/d435-real] [--out FILE.png]

    dots' share    root mean square of the left image less its Gaussian blur (8 px), over its mean above the black
                   level, times the distance squared (dots get weaker, the room's light does not): as at 1 m, %. The
                   recording's is of the side of its box, on which nothing is printed; the wall's of the median patch
    noise          root mean square distance of disparities from their own plane, patches of 48 px, the median, px

The wall's patches lie in the middle 60 % of the image, above the table and below the pattern's border.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import cv2
import numpy as np
from bench_camera import before_table_top
from bench_pairs import plane_residual
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from activestereo import StereoDepthSensorConfig

DATA = Path(os.environ.get("ACTIVESTEREO_DATA", Path(__file__).parents[3] / "shared")) / "data" / "d435-real"
BLUR_PX = 8.0
PATCH_PX = 48
BLACK_DN = 20.0  # the least count of the recording, and of the preset
BOX_SIDE = np.s_[285:325, 240:330]
BOX_DISTANCE_M = 0.442  # the device's own, median
WALL_ROWS = (96, 144)
NOISE_PX = "0.06-0.09"  # of D435 recordings to 2 m, as bench_camera.py has it
CROP = (100, 140)
# Upper left corners of what is 0.4 to 0.5 m away, and 0.6 m: the box's side and the table.
CROPS = {"a real D435": (240, 205), "simulated": (350, 330)}


def dots_share(image: NDArray[np.float64], part: tuple[slice, slice], distance_m: float) -> float:
    blurred = gaussian_filter(image, BLUR_PX)
    dots, light = (image - blurred)[part], blurred[part] - BLACK_DN
    return float(100.0 * dots.std() / light.mean() * distance_m**2)


def simulated() -> tuple[NDArray[np.float64], NDArray[np.float32], float]:
    """(left image, disparity, focal length times baseline) of the table-top."""
    sensor = before_table_top(StereoDepthSensorConfig("D435"))
    focal_baseline_px_m = sensor.get_config().focal_baseline_px_m
    return sensor.get_ir_measured()[0].astype(float), sensor.get_disparity(), focal_baseline_px_m


def wall_figures(image: NDArray[np.float64], disparity: NDArray[np.float32], px_m: float) -> tuple[float, float]:
    """(dots' share, noise) of the wall."""
    width = image.shape[1]
    shares, noises = [], []
    for x in range(int(0.2 * width), int(0.8 * width) - PATCH_PX, PATCH_PX // 2):
        part = np.s_[WALL_ROWS[0] : WALL_ROWS[1], x : x + PATCH_PX]
        measured = np.where(disparity[part] > 0, disparity[part], np.nan)
        distance_m = px_m / float(np.nanmedian(measured))
        if distance_m > 1.1:  # else the vase stands before it
            shares.append(dots_share(image, part, distance_m))
            noises.append(plane_residual(measured))
    return float(np.median(shares)), float(np.median(noises))


def draw(images: dict[str, NDArray[np.float64]], captions: dict[str, str]) -> Figure:
    height, width = CROP
    figure = Figure(figsize=(2 * 4.2 + 0.2, 4.2 * height / width + 0.55), layout="constrained")
    for axes, (name, image) in zip(figure.subplots(1, 2), images.items(), strict=True):
        y, x = CROPS[name]
        axes.imshow(image[y : y + height, x : x + width], cmap="gray", vmin=BLACK_DN, vmax=140, interpolation="nearest")
        axes.set_title(f"{name}: {captions[name]}", fontsize=9, loc="left")
        axes.set_axis_off()
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="?", default=DATA, help="folder with left.png of the recording")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the picture to write, PNG")
    args = parser.parse_args()
    recorded = cv2.imread(str(args.data / "left.png"), cv2.IMREAD_UNCHANGED)
    if recorded is None:
        raise SystemExit(f"{args.data}: no left.png of a recording is there; ACTIVESTEREO_DATA names another place")
    real = recorded.astype(float)
    image, disparity, px_m = simulated()
    share, noise = wall_figures(image, disparity, px_m)
    real_share = dots_share(real, BOX_SIDE, BOX_DISTANCE_M)
    print("|D435|recorded|simulated|\n|--|--|--|")
    print(f"|dots' share at 1 m, %|{real_share:.1f}|{share:.1f}|")
    print(f"|noise of the wall, px|{NOISE_PX}|{noise:.3f}|")
    if args.out:
        captions = {"a real D435": f"dots have {real_share:.1f} % of the light at 1 m",
                    "simulated": f"{share:.1f} %; the wall's noise is {noise:.2f} px"}  # fmt: skip
        draw({"a real D435": real, "simulated": image}, captions).savefig(args.out, dpi=90)


if __name__ == "__main__":
    main()
