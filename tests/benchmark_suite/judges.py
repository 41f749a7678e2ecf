#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Matches other cameras' recordings from public repositories and compares depth with what is known of each.

    PYTHONPATH=build/python python3 tests/benchmark_suite/judges.py CLONES OUT

prints rows of `judges` in examples/real_camera/results.json: each figure is of the profiles `active` and `engine`, and
the mean of a row's pairs. CLONES holds a clone of each repository as OWNER/NAME; OUT gets the pairs and disparities.
"""

import argparse
import json
import subprocess
from pathlib import Path

import cv2
import numpy as np

from activestereo.cli import main as activestereo

PROFILES, PATCH_PX, WRONG_PX = ("active", "engine"), 41, 2.0
HJS, ASGRASP, D3ROMA = "HJS-HJS/ir-patterned-depth-image-generator", "Zhoues/ASGrasp", "jie0530/d3roma"
PLANTS, NSL, ORBBEC = "Jstar0525/RGB-Data-Collection", "Namisntimpot/NSL", "ofeng-spac/fueling_gz2026_3_4"
ROOM, LEAF, DOTS, LIT = "datasets/Real/xiaomeng/0000", "data/realsense", "tests/evaluation", "fueling/initialization"
D435I = ("642.5,642.5,639.5,359.5", 0.05, 128)
ARMS = {"arm1": ("958.76,959.74,627.92,408.17", 0.074985, 320), "arm2": ("950.94,951.5,645.07,410.89", 0.074985, 320)}


def leaves(dots, time):
    return [
        *(f"{LEAF}/{dots}/{side}_{time}.png" for side in ("left", "right")),
        f"{LEAF}/{dots}/depth_{time}.npy",
        *D435I,
    ]


def tank(images, network, arm):
    """Returns a pair of a camera on a robot's arm, above a translucent tank on a steel table."""
    pair = [f"{images}/captured_{side}_ir.png" for side in ("left", "right")]
    return [*pair, f"{network}/left_disp.pkl", *ARMS[arm]]


def lit(place):
    return tank(f"{LIT}/orbbec_output/{place}", f"{LIT}/output_disparity/orbbec/{place}", place.split("/")[1])


def dots(time, arm):
    return tank(f"{DOTS}/{time}/images_output/{arm}", f"{DOTS}/{time}/output_disparity/{arm}", arm)


# (repository, camera, truth, [(left, right, truth's file or None, K, baseline in metres, disparities searched)])
JUDGES = [
    (HJS, "D415", "a flat board at 1 m",
     [("images_real/image0.png", "images_real/image1.png", None, "900,900,639.5,359.5", 0.055, 64)]),
    (ASGRASP, "D415, dim", "a flat table",
     [("test_data/2_ir1_image.png", "test_data/2_ir2_image.png", None, "446,446,320,180", 0.055, 64)]),
    (D3ROMA, "D415", "its own depth",
     [(f"{ROOM}_ir_l.png", f"{ROOM}_ir_r.png", f"{ROOM}_depth.png", "443.9146,443.9146,315.94,186.57", 0.05478, 80)]),
    (PLANTS, "D435i, dots on", "its own depth", [leaves("ir_on", "20200819_235924")]),
    (PLANTS, "D435i, dots off", "its own depth", [leaves("ir_off", "20200910_142445")]),
    (ORBBEC, "dots", "a network's disparity",
     [dots("20251002_172750", "arm1"), dots("20251002_172833", "arm2"), dots("20251006_212954", "arm1")]),
    (ORBBEC, "even light", "a network's disparity",
     [lit(f"Flood_light/{p}") for p in ("arm1/pot1", "arm1/pot3", "arm1/pot5", "arm2/pot2", "arm2/pot4")]),
    (NSL, "dots, 2040x1050", "none: its pattern, no depth",
     [("example/tearoom/limg_lr.png", "example/tearoom/rimg_lr.png", None, "2000,2000,1020,525", 0.1, 384)]),
]  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clones", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    rows = []
    for repository, camera, truth, pairs in JUDGES:
        told = np.array([[figures(args, repository, pair, profile) for profile in PROFILES] for pair in pairs])
        fill, noise, wrong, off = np.nanmean(told, axis=0).T
        row = [f"{repository}, {camera}", truth, _words(fill, ".3f"), _words(noise, ".3f"), _words(wrong, ".3f")]
        rows.append([*row, _words(off, "+.2f")])
    print(*(json.dumps(row) for row in rows), sep=",\n")


def figures(args, repository, pair, profile):
    """Returns (fill, noise_px(), the share of pixels beyond WRONG_PX of the truth, the median difference in px)."""
    left, right, truth, K, baseline_m, count = pair
    clone = args.clones / repository
    files = {}
    for path in filter(None, (left, right, truth)):
        files[path] = args.out / repository / path
        files[path].parent.mkdir(parents=True, exist_ok=True)
        files[path].write_bytes(subprocess.run(["git", "-C", clone, "show", f"HEAD:{path}"], check=True,
                                               capture_output=True).stdout)  # fmt: skip
    out = files[left].parent / profile
    where = ["--k", K, "--baseline", str(baseline_m), "--max-disparity", str(count)]
    if activestereo(["depth", str(files[left]), str(files[right]), *where, "--profile", profile, "-o", str(out)]):
        raise SystemExit(1)
    ours = np.load(out / "disparity.npy").astype(np.float64)
    if truth is None:
        return np.mean(ours > 0), noise_px(ours), np.nan, np.nan
    known = disparity_of(files[truth], float(K.split(",")[0]) * baseline_m, ours.shape)
    rest = (ours - known)[(ours > 0) & (known > 0)]
    return np.mean(ours > 0), noise_px(ours), np.mean(np.abs(rest) > WRONG_PX), np.median(rest)


def disparity_of(path, focal_baseline_px_m, shape):
    """Returns a truth's disparity in px, 0 = unknown. A pickle is not run: its array's bytes are read."""
    if path.suffix == ".pkl":
        content, size = path.read_bytes(), 4 * shape[0] * shape[1]
        start = content.index(b"B" + size.to_bytes(4, "little")) + 5
        return np.frombuffer(content[start : start + size], "<f4").reshape(shape)
    depth_mm = np.load(path) if path.suffix == ".npy" else cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return np.where(depth_mm > 0, 1000.0 * focal_baseline_px_m / np.maximum(depth_mm, 1), 0.0)


def noise_px(disparity):
    """Returns the median over full patches of the RMS about a plane, without outliers; NaN if there is none."""
    v, u = np.mgrid[:PATCH_PX, :PATCH_PX]
    design, out = np.stack([u.ravel(), v.ravel(), np.ones(u.size)], axis=1), []
    for row in range(0, disparity.shape[0] - PATCH_PX, PATCH_PX):
        for column in range(0, disparity.shape[1] - PATCH_PX, PATCH_PX):
            patch = disparity[row : row + PATCH_PX, column : column + PATCH_PX].ravel()
            known = patch > 0
            if known.mean() < 0.95:
                continue
            for _ in range(2):
                rest = patch - design @ np.linalg.lstsq(design[known], patch[known], rcond=None)[0]
                known &= np.abs(rest) < 3.0 * 1.4826 * np.median(np.abs(rest[known]))
            out.append(np.sqrt(np.mean(rest[known] ** 2)))
    return np.median(out) if out else np.nan


def _words(values, form):
    return None if np.isnan(values).any() else "; ".join(f"{value:{form}}" for value in values)


if __name__ == "__main__":
    main()
