# SPDX-License-Identifier: Apache-2.0
"""A usual OpenCV stereo script, and the one line that changes: python disparity.py LEFT.png RIGHT.png [--opencv] [--out
disparity.png]."""

import argparse
import time

import cv2
import numpy as np

import simsense

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("left")
parser.add_argument("right")
parser.add_argument("--opencv", action="store_true", help="compute with OpenCV, as before")
parser.add_argument("--out", default="disparity.png")
args = parser.parse_args()

left, right = (cv2.imread(name, cv2.IMREAD_GRAYSCALE) for name in (args.left, args.right))
if left is None or right is None:
    parser.error(f"cannot read {args.left if left is None else args.right}")
block = 7
settings = dict(
    minDisparity=0,
    numDisparities=128,
    blockSize=block,
    P1=8 * block * block,
    P2=32 * block * block,
    disp12MaxDiff=1,
    uniquenessRatio=10,
    speckleWindowSize=100,
    speckleRange=2,
)
if args.opencv:
    stereo = cv2.StereoSGBM_create(**settings, preFilterCap=31, mode=cv2.STEREO_SGBM_MODE_HH4)
else:
    stereo = simsense.StereoSGM(**settings, preFilterCap=31, mode=simsense.StereoSGM.MODE_HH4)  # the one line

stereo.compute(left, right)  # the first call allocates
start = time.perf_counter()
disparity = stereo.compute(left, right).astype(np.float32) / 16
milliseconds = 1000 * (time.perf_counter() - start)

valid = disparity >= stereo.getMinDisparity()
print(
    f"{'OpenCV' if args.opencv else 'simsense'}: {milliseconds:.1f} ms, {100 * valid.mean():.1f} % of the pixels "
    f"have a disparity"
)
shown = cv2.applyColorMap(np.uint8(np.clip(2 * disparity, 0, 255)), cv2.COLORMAP_TURBO)
shown[~valid] = 0
cv2.imwrite(args.out, shown)
