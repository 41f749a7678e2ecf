#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A lens's falloff cos^n by the overlaps of views alone, beside the product's.

    python3 tests/benchmark_suite/falloff.py ROOM... [--black 4]

Each ROOM is a capture that 'activestereo calibrate world' made. Of every pair of its views, the ratio of one place's
light, dots included, is fitted by n and the views' exposures: trimmed least squares over all pixels, with the room's
poses. It shares no code with the product's estimate. Views must share a place: dots are as bright in both.
"""

import argparse
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np

from activestereo.capture.capture import read_capture

EDGE, SAME, LEAST_DN, WIDE_PX = 0.02, 0.02, 3.0, 8.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", type=Path, nargs="+")
    parser.add_argument("--black", type=float, default=4.0, help="black level, DN")
    args = parser.parse_args()
    for path in args.rooms:
        room = read_capture(path)
        views = [light_of(room, frame, args.black) for frame in room.frames]
        by_pairs = [exponent(room.rig.left.K, *pair) for pair in combinations(views, 2)]
        value, deviation = room.measured["exposure"]["vignetting_exponent"]
        print(f"{path}: by pairs {', '.join(f'{n:.2f}' for n in by_pairs)}; product {value:.2f} +- {deviation:.2f}")


def blur(image):
    return cv2.GaussianBlur(image.astype(np.float32), (0, 0), WIDE_PX)


def light_of(room, frame, black):
    """Returns (mean light around each pixel in DN, points in the camera's frame, mask of smooth surfaces, pose)."""
    K, depth = room.rig.left.K, room.depth(frame)
    image = room.ir(frame, "left").astype(np.float32) - black
    row, column = np.indices(depth.shape, dtype=np.float32)
    points = np.stack([(column - K[0, 2]) / K[0, 0] * depth, (row - K[1, 2]) / K[1, 1] * depth, depth], axis=-1)
    box = np.ones((3, 3))
    edges = cv2.dilate(depth, box) - cv2.erode(depth, box) > EDGE * np.maximum(depth, 1.0)
    smooth = (depth > 0.0) & ~(cv2.dilate(edges.astype(np.uint8), np.ones((7, 7))) > 0)
    light = blur(image * smooth) / np.maximum(blur(smooth), 1e-3)
    return light, points, smooth, frame.camera_to_world


def exponent(K, first, second):
    """Returns n of cos^n by the places that both views show."""
    (here, points, known, pose), (light, others, _, other_pose) = first, second
    step = np.linalg.inv(other_pose) @ pose
    moved = points @ step[:3, :3].T + step[:3, 3]
    u, v, z = np.moveaxis(moved @ K.T, -1, 0)
    at = [np.asarray(x / np.maximum(z, 0.1), np.float32) for x in (u, v)]
    read = lambda image: cv2.remap(image.astype(np.float32), *at, cv2.INTER_LINEAR, borderValue=np.nan)  # noqa: E731
    there, depth = read(light), read(others[..., 2])
    both = known & (np.abs(depth - z) < SAME * z) & (np.minimum(here, there) > LEAST_DN)
    r2 = [((p[both][:, :2] / p[both][:, 2:]) ** 2).sum(axis=-1) for p in (points, moved)]
    design = np.stack([-0.5 * (np.log1p(r2[1]) - np.log1p(r2[0])), np.ones(len(r2[0]))], axis=1)
    ratio = np.log(there[both] / here[both])
    keep = np.ones(len(ratio), bool)
    for _ in range(8):
        fit = np.linalg.lstsq(design[keep], ratio[keep], rcond=None)[0]
        rest = ratio - design @ fit
        keep = np.abs(rest) < 2.5 * 1.4826 * np.median(np.abs(rest))
    return fit[0]


if __name__ == "__main__":
    main()
