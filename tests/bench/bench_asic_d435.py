# SPDX-License-Identifier: Apache-2.0
"""How far the D435 preset's matcher is its ASIC's double, on the one published pair with the device's own depth: n = 1.

    PYTHONPATH=build/python python3 tests/bench/bench_asic_d435.py FOLDER

FOLDER has left.png and right.png of 848x480 (angli66/simsense, test/img), K = 427.12, 426.93, 234.78, baseline 50 mm,
and device_depth_mm.png, decoded from the published picture in colours: uint16 at every second pixel, 0 = none. The
picture's range is inferred, so that the device's disparities may be off by a factor and an offset, which are fitted.

fill: share measured. far: share of those that both measure which differ by more than 1 px. difference: median of the
absolute ones, px. plane: RMS about a matcher's own plane, the median of the patches of 24 x 24 px where the device's is
below 0.2 px. IoU: holes in common over holes of either.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from bench_pairs import host_matcher, plane_residual, tiles
from numpy.typing import NDArray

import simsense
from activestereo.camera.plan import matcher_parameters
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.cli.depth import PROFILES

Map = NDArray[np.float32]
K = np.array([[427.12, 0, 426.93], [0, 427.12, 234.78], [0, 0, 1]])
BASELINE_M, MAX_DISPARITY = 0.05, 96
PATCH, PLANE_PX = 24, 0.2


class Recorded:
    def __init__(self, folder: Path) -> None:
        names = ("left", "right", "device_depth_mm")
        images = [cv2.imread(str(folder / f"{name}.png"), cv2.IMREAD_UNCHANGED) for name in names]
        if any(image is None for image in images):
            raise SystemExit(f"{folder}: left.png, right.png or device_depth_mm.png is missing")
        self.left, self.right, depth = (image if image.ndim == 2 else image[..., 0] for image in images)
        with np.errstate(divide="ignore"):
            self.device = np.where(depth > 0, 1e3 * K[0, 0] * BASELINE_M / depth, np.nan).astype(np.float32)

    def matched(self, parameters: dict[str, object]) -> Map:
        """Disparities at every second pixel, NaN = none."""
        settings = parameters | {"max_disparity": MAX_DISPARITY, "max_depth_m": 100.0}
        return host_matcher(simsense.Camera(848, 480, K), BASELINE_M, **settings)(self.left, self.right)[::2, ::2]

    def figures(self, found: Map) -> list[float]:
        """fill and far in percent, difference and plane in pixels, IoU."""
        both = np.isfinite(found) & np.isfinite(self.device)
        ours, device = found[both].astype(float), self.device[both].astype(float)
        kept = np.ones(len(ours), bool)
        for _ in range(5):
            line = np.polyfit(device[kept], ours[kept], 1)
            error = abs(ours - np.polyval(line, device))
            kept = error < 1.0
        flat = [place for place in tiles(found.shape, PATCH) if plane_residual(self.device[place]) < PLANE_PX]
        holes, device_holes = np.isnan(found), np.isnan(self.device)
        return [
            100 * float(np.isfinite(found).mean()),
            100 * float((error > 1).mean()),
            float(np.median(error)),
            float(np.nanmedian([plane_residual(found[place]) for place in flat])),
            float((holes & device_holes).sum() / (holes | device_holes).sum()),
        ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    recorded = Recorded(parser.parse_args().folder)
    print("| | fill % | far % | difference px | plane px | IoU |\n|--|--|--|--|--|--|")
    for name, found in (
        ("ASIC", recorded.device),
        ("preset D435", recorded.matched(matcher_parameters(StereoDepthSensorConfig("D435")))),
        ("preset D415", recorded.matched(matcher_parameters(StereoDepthSensorConfig("D415")))),
        ("depth --profile active", recorded.matched(dict(PROFILES["active"]))),
    ):
        print(f"| {name} | {' | '.join(f'{value:.3f}' for value in recorded.figures(found))} |")


if __name__ == "__main__":
    main()
