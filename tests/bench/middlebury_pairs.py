# SPDX-License-Identifier: Apache-2.0
"""Writes a folder of pairs for bench_pairs.py from data sets of Middlebury (vision.middlebury.edu/stereo/data).

    PYTHONPATH=build/python python3 tests/bench/middlebury_pairs.py FOLDER SCENE...

A SCENE is a folder of the 2003 sets (im2.png, im6.png, disp2.pgm and disp6.pgm or .png in quarter pixels) or of the
2014 ones (im0.png, im1.png, disp0.pfm). Pixels that the right camera does not see do not count: their match in the 2003
sets' right truth differs by more than a pixel; in the 2014 sets a nearer surface lands on the same right pixel.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import cv2
import numpy as np
from bench_pairs import seen_by_both
from numpy.typing import NDArray

QUARTER = 4  # counts of a pixel in the 2003 sets at 450x375


def first_of(folder: Path, *names: str) -> Path:
    for name in names:
        if (folder / name).exists():
            return folder / name
    raise SystemExit(f"{folder}: no {' or '.join(names)}")


def seen_by_both_2003(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.bool_]:
    match = np.round(np.arange(left.shape[1]) - left).astype(int)
    there = np.take_along_axis(right, np.clip(match, 0, left.shape[1] - 1), 1)
    return (left > 0) & (match >= 0) & (there > 0) & (np.abs(there - left) <= 1)


def write(scene: Path, folder: Path) -> None:
    if (scene / "disp0.pfm").exists():
        pair = (scene / "im0.png", scene / "im1.png")
        disparity = cv2.imread(str(scene / "disp0.pfm"), cv2.IMREAD_UNCHANGED)
        seen = seen_by_both(disparity)
    else:
        pair = (first_of(scene, "im2.png", "im2.ppm"), first_of(scene, "im6.png", "im6.ppm"))
        disparity, other = (
            cv2.imread(str(first_of(scene, f"{name}.pgm", f"{name}.png")), cv2.IMREAD_GRAYSCALE).astype(np.float32)
            / QUARTER
            for name in ("disp2", "disp6")
        )
        seen = seen_by_both_2003(disparity, other)
    to = folder / scene.name
    to.mkdir(parents=True, exist_ok=True)
    for name, path in zip(("left", "right"), pair, strict=True):
        cv2.imwrite(str(to / f"{name}.png"), cv2.imread(str(path)))
    np.save(to / "disparity.npy", np.where(seen, disparity, np.nan).astype(np.float32))
    largest = float(np.nanmax(np.where(seen, disparity, np.nan)))
    (to / "pair.json").write_text(json.dumps({"max_disparity": 16 * int(np.ceil((largest + 1) / 16))}))
    print(f"{to}: {disparity.shape[1]}x{disparity.shape[0]}, up to {largest:.1f} px, {100 * seen.mean():.1f} % count")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("scenes", type=Path, nargs="+")
    args = parser.parse_args()
    for scene in args.scenes:
        write(scene, args.folder)


if __name__ == "__main__":
    main()
