# SPDX-License-Identifier: Apache-2.0
"""How far the D415 preset's matcher is its ASIC's double, on recordings of one D415 with laser truth.

    PYTHONPATH=build/python python3 tests/bench/bench_asic.py FOLDER [--part fit|shown|held-out|development]

FOLDER: data/faro of the public repository UD31415/Fast-FoundationStereo, one folder index_NNNN a view, with img_left,
img_right, img_depth_rs (the ASIC's) and img_depth_faro (a laser scanner's) as 16-bit PNG; depth in millimetres, f x
baseline 49470.45 px mm. The preset was fitted on the scenes of 'fit' and 'shown', halves that scenes go to in turn;
'held-out' was looked at once, after it, and has chosen between designs of its checks since: it is training, too.

fill: share of the visible pixels with truth that are measured. bad-1, bad-2: share of the measured ones that err by
more than 1 and 2 px; with holes: of all, where a hole errs. plane: RMS about a matcher's own plane, the median patch of
48 x 48 px whose truth is a plane. fattening: mean run of foreground disparities beside an edge of the truth's
foreground, px. IoU: holes in common with the ASIC's over holes of either, in all of the image. dark, bright: with holes
where the left image's mean around a pixel is below 12 counts and elsewhere. The ASIC sees 10 bits, a recording has 8;
how much of the difference that makes is unknown.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from bench_pairs import host_matcher, planar_patches, plane_residual
from numpy.typing import NDArray

import simsense
from activestereo.camera.plan import matcher_parameters
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.cli.depth import PROFILES

Map = NDArray[np.float32]
FOCAL_BASELINE_PX_MM = 49470.45
MAX_DISPARITY = 128
PATCH = 48
STEP_PX, EDGE_PX = 3.0, 12
DARK_DN, AROUND_PX = 12.0, 15
# Scenes in order of their first view; some were seen from several places.
SCENES = (("0060",), ("0441",), ("0742",), ("1241",), ("1982",), ("2441", "2537"), ("3049",), ("3375",))
SCENES += (("3617", "3629", "3990"),)
PARTS = {
    "fit": tuple(name for scene in SCENES[::2] for name in scene),
    "shown": tuple(name for scene in SCENES[1::2] for name in scene),
    "development": tuple(name for scene in SCENES for name in scene),
    "held-out": ("4609", "4788", "5646", "5661", "5808", "5881", "5964", "6422", "6461", "6539"),
}


@dataclass
class View:
    """A recorded pair; truth, device: disparities, NaN = none. is_visible: to both cameras, with truth."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    truth: Map
    device: Map
    is_visible: NDArray[np.bool_]

    @classmethod
    def read(cls, folder: Path) -> View:
        left, right, device, truth = (
            cv2.imread(str(folder / f"img_{name}.png"), cv2.IMREAD_UNCHANGED)
            for name in ("left", "right", "depth_rs", "depth_faro")
        )
        if left is None or right is None or device is None or truth is None:
            raise SystemExit(f"{folder}: img_left, img_right, img_depth_rs or img_depth_faro .png is missing")
        pair = (np.clip(image, 0, 255).astype(np.uint8) for image in (left, right))
        truth_px, device_px = _disparity(truth), _disparity(device)
        return cls(*pair, truth_px, device_px, _visible(truth_px) & (truth_px < MAX_DISPARITY - 1))


def _disparity(depth_mm: NDArray[np.generic]) -> Map:
    z = depth_mm.astype(np.float32)
    return np.where(z > 0, FOCAL_BASELINE_PX_MM / np.maximum(z, 1), np.nan).astype(np.float32)


def _visible(truth: Map) -> NDArray[np.bool_]:
    """Where no nearer surface lies before the pixel in the right image."""
    width = truth.shape[1]
    out = np.isfinite(truth)
    for row, visible in zip(truth, out, strict=True):
        d = np.where(visible, row, -1.0)
        at = np.rint(np.arange(width) - d).astype(int)
        inside = (d > 0) & (at >= 0)
        nearest = np.full(width, -1.0)
        np.maximum.at(nearest, at[inside], d[inside])
        around = np.maximum(nearest, np.maximum(np.append(nearest[1:], -1), np.insert(nearest[:-1], 0, -1)))
        visible &= inside & (d >= around[np.clip(at, 0, width - 1)] - 1.0)
    return out


def _fattening(truth: Map, found: Map) -> NDArray[np.float64]:
    """Run of foreground at each edge of the truth, px, on both sides of objects."""
    runs = []
    for turn in (1, -1):
        t, d = truth[:, ::turn], found[:, ::turn]
        y, x = np.nonzero(t[:, 41:-39] - t[:, 40:-40] > STEP_PX)
        x += 40  # the background's last pixel
        behind, before = t[y, x - EDGE_PX], t[y, x + 5]
        is_clean = (before - behind > STEP_PX) & (abs(t[y, x] - behind) < 1.5) & (abs(t[y, x + 1] - before) < 1.5)
        y, x, middle = y[is_clean], x[is_clean], 0.5 * (behind + before)[is_clean]
        goes_on, run = np.ones(len(y), bool), np.zeros(len(y))
        for k in range(EDGE_PX):
            goes_on &= d[y, x - k] > middle
            run += goes_on
        runs.append(run)
    return np.concatenate(runs)


def figures(views: list[View], found: list[Map]) -> list[float]:
    """fill, bad-1, bad-2, bad-2 with holes in %, plane and fattening in px, IoU, with holes in the dark, elsewhere."""
    visible = sum(int(view.is_visible.sum()) for view in views)
    errors = [abs(d - v.truth)[v.is_visible & np.isfinite(d)] for v, d in zip(views, found, strict=True)]
    error = np.concatenate(errors)
    planes = [plane_residual(d[p]) for v, d in zip(views, found, strict=True) for p in planar_patches(v.truth, PATCH)]
    runs = np.concatenate([_fattening(v.truth, d) for v, d in zip(views, found, strict=True)])
    holes = [(np.isnan(d), np.isnan(v.device)) for v, d in zip(views, found, strict=True)]
    common, either = (sum(int(op(a, b).sum()) for a, b in holes) for op in (np.logical_and, np.logical_or))
    lost = [~(abs(d - v.truth) <= 2) for v, d in zip(views, found, strict=True)]
    dark = [cv2.blur(v.left.astype(np.float32), (AROUND_PX, AROUND_PX)) < DARK_DN for v in views]
    parts = [[v.is_visible & (one == side) for v, one in zip(views, dark, strict=True)] for side in (True, False)]
    by_light = [100 * float(np.concatenate([a[b] for a, b in zip(lost, part, strict=True)]).mean()) for part in parts]
    return [
        100 * len(error) / visible,
        100 * float((error > 1).mean()),
        100 * float((error > 2).mean()),
        100 * float((error > 2).sum() + visible - len(error)) / visible,
        float(np.nanmedian(planes)),
        float(runs.mean()),
        common / either,
        *by_light,
    ]


def matcher(parameters: dict[str, object]) -> Callable[[View], Map]:
    """A matcher of simsense's engine for images of 1280x720."""
    camera = simsense.Camera(1280, 720, [[903.5, 0, 631.9], [0, 903.5, 369.3], [0, 0, 1]])
    settings = parameters | {"max_disparity": MAX_DISPARITY, "max_depth_m": 100.0}
    match = host_matcher(camera, 1e-3 * FOCAL_BASELINE_PX_MM / 903.5, **settings)
    return lambda view: match(view.left, view.right)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--part", choices=PARTS, default="held-out")
    args = parser.parse_args()
    views = [View.read(args.folder / f"index_{name}") for name in PARTS[args.part]]
    preset = matcher(matcher_parameters(StereoDepthSensorConfig("D415")))
    active = matcher(dict(PROFILES["active"]))
    rows = {
        "ASIC": [view.device for view in views],
        "preset D415": [preset(view) for view in views],
        "depth --profile active": [active(view) for view in views],
    }
    print(f"{args.part}, {len(views)} views\n")
    names = ("fill %", "bad-1 %", "bad-2 %", "with holes %", "plane px", "fattening px", "IoU", "dark %", "bright %")
    print(f"| | {' | '.join(names)} |\n|{'--|' * (len(names) + 1)}")
    found = {name: figures(views, maps) for name, maps in rows.items()}
    for name, values in found.items():
        print(f"| {name} | {' | '.join(f'{value:.3f}' for value in values)} |")
    ratios = [a / b for a, b in zip(found["preset D415"], found["ASIC"], strict=True)]
    print(f"| preset over ASIC | {' | '.join(f'{ratio:.3f}' for ratio in ratios)} |")


if __name__ == "__main__":
    main()
