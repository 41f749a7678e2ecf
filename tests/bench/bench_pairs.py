# SPDX-License-Identifier: Apache-2.0
"""How well stereo matchers do on a folder of pairs with truth: simsense's settings beside OpenCV's matchers, in one
run.

    PYTHONPATH=build/python python3 tests/bench/bench_pairs.py FOLDER

FOLDER holds one folder per pair. tests/bench/noisy_planes.py writes such a folder; recordings with truth fit in the
same way:

    NAME/left.png, right.png    the rectified pair, 8 or 16 bit; of colour images the mean of the channels is taken
    NAME/disparity.npy          truth in pixels of the left image: float, or .pfm, or a 16-bit .png in 1/256 px; what
                                is not finite or not above 0 is unknown
    NAME/mask.png               optional: only where it is not 0 pixels count, for example those that both cameras see
    NAME/pair.json              optional: {"max_disparity": 128}; 128 without it

Each figure is over the pixels with known truth, of all pairs together. fill: share with a measurement. bad-2: share
of the measured ones that err by more than 2 px. incl. holes: the same over all pixels, where a hole is an error.
plane: root mean square distance of a matcher's disparities from its own plane, over patches of 96 x 96 px whose truth
is a plane, the median patch. CPU s: processor time per pair.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.cli.depth import PROFILES
from activestereo.common.pose import rigid_motion

Image = NDArray[np.generic]
Matcher = Callable[[Image, Image, int], NDArray[np.float32]]

PATCH = 96
PLANE_RMS_PX = 0.05  # truth that lies this close to a plane is one
BAD_PX = 2.0


def read_disparity(folder: Path, stem: str) -> NDArray[np.float32] | None:
    """A disparity map in pixels, NaN where it is unknown; None where there is no such file."""
    for suffix in (".npy", ".pfm", ".png"):
        path = folder / f"{stem}{suffix}"
        if not path.exists():
            continue
        values = np.load(path) if suffix == ".npy" else cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if values is None or values.ndim != 2:
            raise SystemExit(f"{path}: must be one channel of disparities")
        values = values.astype(np.float32) / (256 if suffix == ".png" else 1)
        return np.where(np.isfinite(values) & (values > 0), values, np.nan).astype(np.float32)
    return None


def read_gray(path: Path) -> Image:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise SystemExit(f"{path}: no image that can be read")
    return image if image.ndim == 2 else image[..., :3].mean(axis=2).round().astype(image.dtype)


@dataclass
class Pair:
    """A pair with its truth [height, width]; what does not count is NaN."""

    name: str
    left: Image
    right: Image
    truth: NDArray[np.float32]
    max_disparity: int

    @classmethod
    def read(cls, folder: Path) -> Pair:
        truth = read_disparity(folder, "disparity")
        if truth is None:
            raise SystemExit(f"{folder}: no disparity.npy, .pfm or .png with the truth")
        left, right = read_gray(folder / "left.png"), read_gray(folder / "right.png")
        if left.shape != right.shape or left.shape != truth.shape:
            raise SystemExit(f"{folder}: left is {left.shape}, right {right.shape}, truth {truth.shape}: must be alike")
        if (folder / "mask.png").exists():
            truth = np.where(read_gray(folder / "mask.png") > 0, truth, np.float32(np.nan))
        settings = json.loads((folder / "pair.json").read_text()) if (folder / "pair.json").exists() else {}
        return cls(folder.name, left, right, truth, settings.get("max_disparity", 128))


def host_matcher(camera: simsense.Camera, baseline_m: float, **settings: object) -> Callable[..., NDArray[np.float32]]:
    """A function of a rectified pair of simsense's engine on the processor: disparities, NaN = no measurement."""
    left_to_right = rigid_motion((-baseline_m, 0, 0))
    engine = simsense.Engine(simsense.Device("host"), camera, camera, left_to_right, rectified=True, **settings)

    def match(left: Image, right: Image) -> NDArray[np.float32]:
        disparity = engine.compute(left, right, ("disparity",))["disparity"]
        return np.where(disparity >= 0, disparity, np.nan).astype(np.float32)

    return match


def ours(**settings: object) -> Matcher:
    """A matcher of simsense's engine, made once per size of image."""

    @cache
    def matcher(width: int, height: int, max_disparity: int, wide: bool) -> Callable[..., NDArray[np.float32]]:
        camera = simsense.Camera(width, height, [[width, 0, width / 2], [0, width, height / 2], [0, 0, 1]])
        signal = {"bit_depth": 16} if wide else {}
        return host_matcher(camera, 0.05, max_disparity=max_disparity, **(signal | settings))

    def match(left: Image, right: Image, max_disparity: int) -> NDArray[np.float32]:
        if left.dtype == np.uint16 and "p2_full_gradient_dn" in settings:
            raise SystemExit("the profile passive is told in counts of 8 bit: write such pictures")
        return matcher(left.shape[1], left.shape[0], max_disparity, left.dtype == np.uint16)(left, right)

    return match


def opencv(make: Callable[[int], cv2.StereoMatcher]) -> Matcher:
    """One of OpenCV's, padded on the left so that it gives every column; 8 bit."""

    def match(left: Image, right: Image, max_disparity: int) -> NDArray[np.float32]:
        scale = 255 / max(left.max(), right.max(), 255)
        padded = (
            cv2.copyMakeBorder((image * scale).astype(np.uint8), 0, 0, max_disparity, 0, cv2.BORDER_REPLICATE)
            for image in (left, right)
        )
        disparity = make(max_disparity).compute(*padded)[:, max_disparity:].astype(np.float32) / 16
        return np.where(disparity >= 0, disparity, np.nan).astype(np.float32)

    return match


def sgbm(mode: int, block: int, uniqueness: int = 15) -> Matcher:
    return opencv(
        lambda disparities: cv2.StereoSGBM_create(
            minDisparity=0, numDisparities=disparities, blockSize=block, P1=8 * block**2, P2=32 * block**2,
            disp12MaxDiff=1, preFilterCap=63, uniquenessRatio=uniqueness, mode=mode,
        )
    )  # fmt: skip


HH4, THREE_WAY = cv2.STEREO_SGBM_MODE_HH4, cv2.STEREO_SGBM_MODE_SGBM_3WAY
MATCHERS: dict[str, Matcher] = {
    "simsense, default": ours(),
    "simsense, depth --profile active": ours(**PROFILES["active"]),
    "simsense, depth --profile passive": ours(**PROFILES["passive"]),  # of 8 bit
    "OpenCV SGBM HH4, block 7": sgbm(HH4, 7),
    "OpenCV SGBM HH4, block 3, uniqueness 5": sgbm(HH4, 3, 5),
    "OpenCV SGBM 3WAY, block 7": sgbm(THREE_WAY, 7),
}


def plane_residual(disparity: NDArray[np.float32]) -> float:
    """RMS distance of a patch from its own plane, without outliers; NaN where less than half is measured."""
    y, x = np.nonzero(np.isfinite(disparity))
    values = disparity[y, x].astype(float)
    if len(values) < 0.5 * disparity.size:
        return np.nan
    terms = np.stack([x, y, np.ones_like(x)], axis=1).astype(float)
    kept = np.ones(len(values), bool)
    residual = values
    for _ in range(4):
        plane, *_ = np.linalg.lstsq(terms[kept], values[kept], rcond=None)
        residual = values - terms @ plane
        kept = np.abs(residual) < 1
    return float(np.sqrt(np.mean(residual[kept] ** 2)))


def seen_by_both(disparity: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels of known disparity that the right camera sees too: nothing nearer lands where they do."""
    rows, columns = np.nonzero(np.isfinite(disparity))
    d = disparity[rows, columns]
    target = np.rint(columns - d).astype(int)
    inside = (target >= 0) & (target < disparity.shape[1])
    rows, columns, target, d = rows[inside], columns[inside], target[inside], d[inside]
    nearest = np.zeros_like(disparity)
    np.maximum.at(nearest, (rows, target), d)
    seen = np.zeros(disparity.shape, bool)
    seen[rows, columns] = d >= nearest[rows, target] - 1
    return seen


def tiles(shape: tuple[int, ...], side: int) -> list[tuple[slice, slice]]:
    """All whole squares of an image, row by row."""
    rows, columns = (range(0, size - side + 1, side) for size in shape)
    return [(slice(y, y + side), slice(x, x + side)) for y in rows for x in columns]


def planar_patches(truth: NDArray[np.float32], side: int = PATCH) -> list[tuple[slice, slice]]:
    known = (p for p in tiles(truth.shape, side) if np.isfinite(truth[p]).mean() > 0.95)
    return [p for p in known if plane_residual(truth[p]) < PLANE_RMS_PX]


@dataclass
class Tally:
    """Sums over pairs."""

    known: int = 0
    measured: int = 0
    bad: int = 0
    planes: list[float] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)

    def add(self, pair: Pair, disparity: NDArray[np.float32], cpu_s: float) -> None:
        known = np.isfinite(pair.truth)
        measured = known & np.isfinite(disparity)
        error = np.abs(np.where(measured, disparity - pair.truth, 0))
        bad = measured & (error > BAD_PX)
        self.known += int(known.sum())
        self.measured += int(measured.sum())
        self.bad += int(bad.sum())
        self.planes += [plane_residual(disparity[p]) for p in planar_patches(pair.truth)]
        self.cpu_s.append(cpu_s)

    def row(self, name: str) -> str:
        def percent(part: int, whole: int) -> str:
            return f"{100 * part / whole:.2f}" if whole else "-"

        planes = [p for p in self.planes if np.isfinite(p)]
        cells = [
            percent(self.measured, self.known),
            percent(self.bad, self.measured),
            percent(self.bad + self.known - self.measured, self.known),
            f"{np.median(planes):.3f}" if planes else "-",
            f"{np.median(self.cpu_s):.3f}",
        ]
        return f"| {name} | {' | '.join(cells)} |"


HEADER = "| | fill % | bad-2 % | incl. holes % | plane px | CPU s |\n|--|--|--|--|--|--|"


def timed(matcher: Matcher, pair: Pair) -> tuple[NDArray[np.float32], float]:
    matcher(pair.left, pair.right, pair.max_disparity)  # memory is taken once
    start = time.process_time()
    disparity = matcher(pair.left, pair.right, pair.max_disparity)
    return disparity, time.process_time() - start


def table(pairs: list[Pair]) -> str:
    rows = {name: Tally() for name in MATCHERS}
    for pair in pairs:
        for name, matcher in MATCHERS.items():
            rows[name].add(pair, *timed(matcher, pair))
    return "\n".join([HEADER, *(tally.row(name) for name, tally in rows.items())])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of pairs")
    args = parser.parse_args()
    folders = sorted(path.parent for path in args.folder.glob("*/left.png"))
    if not folders:
        raise SystemExit(f"{args.folder}: no pair in it: a pair is a folder with left.png, right.png and disparity.npy")
    pairs = [Pair.read(folder) for folder in folders]
    print(f"\n{len(pairs)} pairs\n\n{table(pairs)}")


if __name__ == "__main__":
    main()
