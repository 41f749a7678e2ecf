# SPDX-License-Identifier: Apache-2.0
"""Writes a folder of pairs with exact truth for bench_pairs.py: dots of a projector on planes and steps, with the
noise of real cameras.

    python3 tests/bench/noisy_planes.py FOLDER [--seed 1]

The pairs are 848 x 480 with a focal length of 617 px and a baseline of 55 mm (a D415's at that size). Every dot is
a Gaussian spot that each camera sees at its exact place, integrated over the pixels; nothing is resampled. What was
measured on recordings of D415s (24 frames with laser-scanner truth; walls at 1 and 2 m) and is taken over:

    dots per 1000 px            7
    dot RMS at 1 m, 2 m         4.4, 1.9 DN, falling as 1.2 powers of distance in between and beyond
    left-right residual         16 % of the dot RMS at 1 m, 25 % at 2 m: speckle that differs between the cameras, a
                                factor per dot and camera
    black level                 4 DN
    temporal noise              0.5 DN at 30 DN: variance 0.0075 DN per DN of signal, and 0.1 DN squared

The room's infrared light is 26 DN with a faint texture, except in the pairs named dark, which have next to none.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.special import erf

WIDTH, HEIGHT = 848, 480
FOCAL_BASELINE_PX_M = 617 * 0.055
DOTS_PER_PX = 7 / 1000
DOT_SIGMA_PX = 0.9
BLACK_DN = 4.0
NOISE_DN_PER_DN, NOISE_FLOOR_DN = 0.0075, 0.1

Field = NDArray[np.float64]


def dot_rms_dn(distance_m: float) -> float:
    return 4.4 * distance_m**-1.2


def residual_share(distance_m: float) -> float:
    """The share of the dot RMS that the two cameras see differently."""
    return 0.16 + 0.09 * (distance_m - 1)


def plane(distance_m: float, tilt_deg: float) -> Field:
    """Disparity of a plane through (0, 0, distance), turned about the vertical and horizontal axes."""
    x, y = (np.arange(WIDTH) - WIDTH / 2) / 617, (np.arange(HEIGHT)[:, None] - HEIGHT / 2) / 617
    slope = np.tan(np.radians(tilt_deg))
    return FOCAL_BASELINE_PX_M / distance_m * (1 + slope * x + 0.5 * slope * y)


def steps(distance_m: float, rng: np.random.Generator) -> Field:
    """Boxes of many sizes before a wall."""
    disparity = plane(distance_m, 5)
    for _ in range(14):
        width, height = rng.integers(20, 160, 2)
        x, y = rng.integers(0, WIDTH - width), rng.integers(0, HEIGHT - height)
        disparity[y : y + height, x : x + width] = FOCAL_BASELINE_PX_M / (distance_m * rng.uniform(0.6, 0.95))
    return disparity


def right_view(disparity: Field, x: Field, y: Field) -> tuple[Field, NDArray[np.bool_]]:
    """Where left positions stand in the right image, and whether it sees them: nothing nearer covers them there."""
    d = map_coordinates(disparity, [y, x], order=0, mode="nearest")
    nearest = np.full((HEIGHT, WIDTH + 400), -np.inf)  # columns from -200 on
    rows, columns = np.nonzero(np.ones_like(disparity))
    for shift in (0.25, 0.75):
        at = np.round(columns + shift - disparity[rows, columns]).astype(int) + 200
        np.maximum.at(nearest, (rows, at.clip(0, WIDTH + 399)), disparity[rows, columns])
    at = np.round(x - d).astype(int).clip(-200, WIDTH + 199) + 200
    return x - d, nearest[np.round(y).astype(int).clip(0, HEIGHT - 1), at] < d + 1


def splat(x: Field, y: Field, power: Field) -> Field:
    """Gaussian spots, integrated over each pixel."""
    image = np.zeros((HEIGHT, WIDTH))
    reach = int(np.ceil(4 * DOT_SIGMA_PX))
    for u, v, p in zip(x, y, power):
        left, top = int(round(u)) - reach, int(round(v)) - reach
        columns = np.arange(max(left, 0), min(left + 2 * reach + 1, WIDTH))
        rows = np.arange(max(top, 0), min(top + 2 * reach + 1, HEIGHT))
        if not len(columns) or not len(rows):
            continue
        scale = 1 / (np.sqrt(2) * DOT_SIGMA_PX)
        along = 0.5 * np.diff(erf((np.append(columns, columns[-1] + 1) - 0.5 - u) * scale))
        down = 0.5 * np.diff(erf((np.append(rows, rows[-1] + 1) - 0.5 - v) * scale))
        image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += p * np.outer(down, along)
    return image


def counts(light_dn: Field, rng: np.random.Generator) -> NDArray[np.uint8]:
    noise = rng.normal(size=light_dn.shape) * np.sqrt(NOISE_DN_PER_DN * light_dn + NOISE_FLOOR_DN**2)
    return np.clip(np.rint(light_dn + noise + BLACK_DN), 0, 255).astype(np.uint8)


def room(disparity: Field, ambient_dn: float, rng: np.random.Generator) -> tuple[Field, Field]:
    """The room's light in both cameras: smooth, with a faint texture that moves with the surface."""
    texture = gaussian_filter(rng.normal(size=(HEIGHT, WIDTH + 400)), 6)
    texture = ambient_dn * (1 + 0.05 * texture / texture.std())
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    left = map_coordinates(texture, [y, x + 200], order=3, mode="nearest")
    source = x.copy()
    for _ in range(20):  # the left column that stands at column x of the right image
        source = x + map_coordinates(disparity, [y, source], order=0, mode="nearest")
    return left, map_coordinates(texture, [y, source + 200], order=3, mode="nearest")


def make_pair(
    disparity: Field, distance_m: float, ambient_dn: float, rng: np.random.Generator
) -> dict[str, NDArray[np.generic]]:
    number = int(DOTS_PER_PX * (WIDTH + 200) * HEIGHT)
    x, y = rng.uniform(-100, WIDTH + 100, number), rng.uniform(-2, HEIGHT + 2, number)
    power = rng.lognormal(0, 0.35, number)
    right_x, seen = right_view(disparity, x, y)
    # a factor per dot and camera, whose difference has the measured share of the dots' contrast
    sigma = residual_share(distance_m) / np.sqrt(2)
    left = splat(x, y, power * rng.gamma(sigma**-2, sigma**2, number))
    right = splat(right_x[seen], y[seen], (power * rng.gamma(sigma**-2, sigma**2, number))[seen])
    scale = dot_rms_dn(distance_m) / left.std()
    room_left, room_right = room(disparity, ambient_dn, rng)
    columns, rows = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    in_right, both = right_view(disparity, columns.ravel(), rows.ravel())
    inside = (in_right >= 0).reshape(HEIGHT, WIDTH)
    return {
        "left": counts(left * scale + room_left, rng),
        "right": counts(right * scale + room_right, rng),
        "disparity": np.where(both.reshape(HEIGHT, WIDTH) & inside, disparity, 0).astype(np.float32),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    tilts_deg = {0.7: 15, 1: 0, 1.5: 25, 2: 10, 3: 20, 4: 5}  # by distance, metres
    scenes = [(f"plane-{d:g}m", plane(d, tilt), d, 26.0) for d, tilt in tilts_deg.items()]
    scenes += [(f"steps-{d:g}m", steps(d, rng), d, 26.0) for d in (0.8, 1.2, 2, 3)]
    scenes += [(f"dark-{d:g}m", steps(d, rng), d, 1.0) for d in (1, 2, 3)]
    for name, disparity, distance_m, ambient_dn in scenes:
        folder = args.folder / name
        folder.mkdir(parents=True, exist_ok=True)
        pair = make_pair(disparity, distance_m, ambient_dn, rng)
        np.save(folder / "disparity.npy", pair["disparity"])
        for side in ("left", "right"):
            cv2.imwrite(str(folder / f"{side}.png"), pair[side])
        (folder / "pair.json").write_text(json.dumps({"max_disparity": 96}))
        print(f"{folder}: dots {pair['left'].std():.1f} DN RMS")


if __name__ == "__main__":
    main()
