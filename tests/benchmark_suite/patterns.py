#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Projector patterns of the presets beside those that a public repository states.

    PYTHONPATH=build/python python3 tests/benchmark_suite/patterns.py CLONE

CLONE is a clone of Namisntimpot/NSL, which holds a D415's and a D435's pattern as pictures, without their origin. It
prints rows of `patterns` in examples/real_camera/results.json. Lengths are in mean spacings, the root of the area per
dot, since the pictures have no field of view.
"""

import argparse
import json
import subprocess
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter
from scipy.spatial import cKDTree

from activestereo.camera.plan import pattern_of
from activestereo.camera.presets import StereoDepthSensorConfig

# A dot is the largest value of a square this wide, above a share of the brightest; slow light is wider than SLOW_PX.
WINDOW_PX, DOT_SHARE, SLOW_PX = 5, 0.25, 40
RING = 0.7, 2.5  # mean spacings in which the side peak lies


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clone", type=Path)
    clone = parser.parse_args().clone
    for name in ("D415", "D435"):
        path = f"HEAD:datasets/patterns/{name}.png"
        stored = subprocess.run(["git", "-C", clone, "show", path], check=True, capture_output=True).stdout
        theirs = cv2.imdecode(np.frombuffer(stored, np.uint8), cv2.IMREAD_GRAYSCALE)
        ours, _ = pattern_of(StereoDepthSensorConfig(name))
        for whose, image in (("Namisntimpot/NSL", theirs), ("the preset", ours)):
            print(json.dumps([f"{name}, {whose}", *(f"{value:.2f}" for value in figures(image))]))


def figures(image):
    """Returns (median distance of the nearest dot, its standard deviation over its mean, the autocorrelation's side
    peak, its distance, the mean over the brightest pixel). Distances are in mean spacings."""
    image = image / image.max()
    smooth = gaussian_filter(image, 0.7)
    is_dot = (smooth == maximum_filter(smooth, WINDOW_PX)) & (smooth > DOT_SHARE * np.quantile(smooth, 0.999))
    places = np.argwhere(is_dot)
    spacing_px = np.sqrt(image.size / len(places))
    nearest = cKDTree(places).query(places, 2)[0][:, 1]
    power = np.abs(np.fft.fft2(image - gaussian_filter(image, SLOW_PX))) ** 2
    correlation = np.fft.fftshift(np.fft.ifft2(power).real / power.mean())
    rows, columns = np.indices(image.shape)
    apart = np.hypot(rows - image.shape[0] // 2, columns - image.shape[1] // 2) / spacing_px
    ring = (apart > RING[0]) & (apart < RING[1])
    peak = np.argmax(correlation[ring])
    spread = nearest.std() / nearest.mean()
    return np.median(nearest) / spacing_px, spread, correlation[ring][peak], apart[ring][peak], image.mean()


if __name__ == "__main__":
    main()
