# SPDX-License-Identifier: Apache-2.0
"""A text of rs-enumerate-devices -c for a D435, and pairs of that size."""

import numpy as np

from activestereo.capture.images import write_gray

_INTRINSIC = """\
 Intrinsic of "{}" / 64x48 / {{{}}}
  Width:      	64
  Height:     	48
  PPX:        	32.1
  PPY:        	24.2
  Fx:         	43.0
  Fy:         	{}
  Distortion: 	Brown Conrady
  Coeffs:     	0  	0  	0  	0  	0
  FOV (deg):  	73.3 x 58.3

"""
_STREAMS = ("Depth", "Z16", 43.0), ("Infrared 1", "Y8", 43.5), ("Infrared 2", "Y8", 43.5)
ENUMERATED = """\
Device info:
    Name                          : 	Intel RealSense D435

Intrinsic Parameters:

{intrinsics}Extrinsic Parameters:
 Extrinsic from "Infrared 1"	  To	  "Infrared 2" :
 Rotation Matrix:
   1                0                0
   0                1                0
   0                0                1

 Translation Vector: -0.0499585680663586  0  0

 Extrinsic from "Infrared 2"	  To	  "Infrared 1" :
 Rotation Matrix:
   1                0                0
   0                1                0
   0                0                1

 Translation Vector: 0.0499585680663586  0  0
""".format(intrinsics="".join(_INTRINSIC.format(*stream) for stream in _STREAMS))


def write_pairs(folder, values, right=1):
    """Pairs of 64x48 in left/ and right/: of one count each, which is `right` more on the right."""
    for side, more in (("left", 0), ("right", right)):
        (folder / side).mkdir(parents=True)
        for i, value in enumerate(values):
            write_gray(folder / side / f"{i:06d}.png", np.full((48, 64), value + more, np.uint8))
