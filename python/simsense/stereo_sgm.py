# SPDX-License-Identifier: Apache-2.0
"""Provides StereoSGM: cv2.StereoSGBM's parameters and result on this engine. A script with cv2.StereoSGBM needs one
line changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._simsense import Camera, Device, Engine, default_parameters

_LARGEST_BLOCK = 15
# OpenCV's parameters in its order, as getX() and setX() name them.
_NAMES = (
    "MinDisparity", "NumDisparities", "BlockSize", "P1", "P2", "Disp12MaxDiff", "PreFilterCap", "UniquenessRatio",
    "SpeckleWindowSize", "SpeckleRange", "Mode",
)  # fmt: skip


def _getter(name: str) -> Callable[[StereoSGM], int]:
    def get(self: StereoSGM) -> int:
        return self._values[name]

    get.__name__ = "get" + name
    return get


def _setter(name: str) -> Callable[[StereoSGM, int], None]:
    def change(self: StereoSGM, value: int) -> None:
        old = self._values[name]
        self._values[name] = value
        try:
            self._parameters()
        except ValueError:
            self._values[name] = old
            raise

    change.__name__ = "set" + name
    return change


class StereoSGM:
    """Computes the disparity of a rectified pair. compute(left, right) returns int16 [height, width] in sixteenths of
    pixels, (minDisparity - 1) * 16 = invalid.

    The parameters are cv2.StereoSGBM's, in its order, with these differences. The cost is census, not
    Birchfield-Tomasi, so preFilterCap has no effect. P1 and P2 are divided by blockSize * blockSize and then count
    differing census bits (1 <= P1 < P2 <= 223 after that). The usual 8 and 32 times the block's area are good values
    here too; 0, 0 means this engine's own. numDisparities is 16..1024 and need not be a multiple of 16. The columns
    left of the largest disparity are computed as well. disp12MaxDiff 0 means 1, as OpenCV takes it; -1 switches the
    check off. A speckleWindowSize of 0 switches the speckle filter off. mode: MODE_HH follows 8 paths, the others 4. A
    3x3 median follows, as in OpenCV.

    device: 'host', 'auto', an index, or a simsense.Device. Raises ValueError out of range. One thread at a time may use
    an object.
    """

    MODE_SGBM = 0
    MODE_HH = 1
    MODE_SGBM_3WAY = 2
    MODE_HH4 = 3
    DISP_SHIFT = 4
    DISP_SCALE = 16

    def __init__(
        self,
        minDisparity: int = 0,
        numDisparities: int = 16,
        blockSize: int = 3,
        P1: int = 0,
        P2: int = 0,
        disp12MaxDiff: int = 0,
        preFilterCap: int = 0,
        uniquenessRatio: int = 0,
        speckleWindowSize: int = 0,
        speckleRange: int = 0,
        mode: int = MODE_SGBM,
        *,
        device: str | int | bytes | Device = "host",
    ) -> None:
        given = (
            minDisparity, numDisparities, blockSize, P1, P2, disp12MaxDiff, preFilterCap, uniquenessRatio,
            speckleWindowSize, speckleRange, mode,
        )  # fmt: skip
        self._values: dict[str, Any] = dict(zip(_NAMES, given, strict=True))
        self._device = device if isinstance(device, Device) else Device(device)
        self._engine: Engine | None = None
        self._size = (0, 0)
        self._parameters()

    getMinDisparity, setMinDisparity = _getter("MinDisparity"), _setter("MinDisparity")
    getNumDisparities, setNumDisparities = _getter("NumDisparities"), _setter("NumDisparities")
    getBlockSize, setBlockSize = _getter("BlockSize"), _setter("BlockSize")
    getP1, setP1 = _getter("P1"), _setter("P1")
    getP2, setP2 = _getter("P2"), _setter("P2")
    getDisp12MaxDiff, setDisp12MaxDiff = _getter("Disp12MaxDiff"), _setter("Disp12MaxDiff")
    getPreFilterCap, setPreFilterCap = _getter("PreFilterCap"), _setter("PreFilterCap")
    getUniquenessRatio, setUniquenessRatio = _getter("UniquenessRatio"), _setter("UniquenessRatio")
    getSpeckleWindowSize, setSpeckleWindowSize = _getter("SpeckleWindowSize"), _setter("SpeckleWindowSize")
    getSpeckleRange, setSpeckleRange = _getter("SpeckleRange"), _setter("SpeckleRange")
    getMode, setMode = _getter("Mode"), _setter("Mode")

    @classmethod
    def create(cls, *args: Any, **kwargs: Any) -> StereoSGM:
        """Returns a new StereoSGM; cv2.StereoSGBM has a constructor of this name."""
        return cls(*args, **kwargs)

    def compute(
        self, left: NDArray[Any], right: NDArray[Any], disparity: NDArray[np.int16] | None = None
    ) -> NDArray[np.int16]:
        """Returns the disparity, see the class. left, right: uint8 or uint16 [height, width], or [height, width, 3]
        BGR. disparity: an int16 array to fill, or None. Raises ValueError for other arrays."""
        left, right = _gray(left, "left"), _gray(right, "right")
        if left.shape != right.shape or left.dtype != right.dtype:
            raise ValueError(f"the images differ: left is {left.shape} {left.dtype}, right {right.shape} {right.dtype}")
        if disparity is not None and (not isinstance(disparity, np.ndarray) or disparity.dtype != np.int16):
            raise ValueError(
                f"disparity must be an int16 array to fill, or None, not {getattr(disparity, 'dtype', disparity)!s}"
            )
        height, width = left.shape
        parameters: dict[str, Any] = self._parameters() | {"bit_depth": 8 * left.itemsize}
        if self._engine is None or self._size != (width, height):
            # Any camera will do: depth is not computed.
            camera, left_to_right = Camera(width, height, [[width, 0, 0], [0, width, 0], [0, 0, 1]]), np.eye(4)
            left_to_right[0, 3] = -1
            self._engine = Engine(self._device, camera, camera, left_to_right, rectified=True, **parameters)
            self._size = (width, height)
        else:
            self._engine.set_parameters(**parameters)
        wanted: Any = np.int16 if disparity is None else disparity
        disparity = self._engine.compute(left, right, {"disparity": wanted})["disparity"]
        if self._values["MinDisparity"] > 0:  # the engine marks invalid pixels with -1 pixel here
            disparity[disparity < 0] = (self._values["MinDisparity"] - 1) * self.DISP_SCALE
        return disparity

    def _parameters(self) -> dict[str, Any]:
        """Returns the engine's parameters. Raises ValueError for a value out of range."""
        v = self._values
        for name, value in v.items():
            if not isinstance(value, (int, np.integer)) or isinstance(value, bool):
                own = name if name in ("P1", "P2") else name[0].lower() + name[1:]
                raise ValueError(f"{own} must be an integer, not {value!r}")
        block = v["BlockSize"]
        if not (0 < block <= _LARGEST_BLOCK and block % 2 == 1):
            raise ValueError(f"blockSize must be odd and in 1..{_LARGEST_BLOCK}, not {block}")
        if not 16 <= v["NumDisparities"] <= 1024:
            raise ValueError(f"numDisparities must be in 16..1024, not {v['NumDisparities']}")
        if v["Mode"] not in (self.MODE_SGBM, self.MODE_HH, self.MODE_SGBM_3WAY, self.MODE_HH4):
            raise ValueError(f"mode must be one of StereoSGM.MODE_*, not {v['Mode']}")
        p1, p2 = v["P1"], v["P2"]
        if p1 == 0 and p2 == 0:  # OpenCV's default, no smoothness at all, is useless: take the engine's
            p1, p2 = (default_parameters()[name] for name in ("p1", "p2"))
        else:
            p1, p2 = max(1, round(p1 / block**2)), round(p2 / block**2)
            if not p1 < p2 < 224:
                raise ValueError(f"P1 and P2 per pixel of the block are {p1} and {p2}: must be 0 < P1 < P2 < 224")
        return {
            "min_disparity": v["MinDisparity"],
            "max_disparity": v["NumDisparities"],
            "block_width": block,
            "block_height": block,
            "p1": p1,
            "p2": p2,
            "lr_max_diff": -1 if v["Disp12MaxDiff"] < 0 else max(1, v["Disp12MaxDiff"]),
            "uniqueness_ratio": min(100, max(0, v["UniquenessRatio"])),
            "speckle_max_size": max(0, v["SpeckleWindowSize"]),
            "speckle_max_diff_px": float(max(0, v["SpeckleRange"])),
            "path_count": 8 if v["Mode"] == self.MODE_HH else 4,
        }


def _gray(image: NDArray[Any], what: str) -> NDArray[Any]:
    image = np.asarray(image)
    if image.dtype not in (np.uint8, np.uint16) or not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        raise ValueError(
            f"{what} must be uint8 or uint16, [height, width] or [height, width, 3], not {image.dtype} {image.shape}"
        )
    if image.ndim == 2:
        return image
    return np.rint(image @ np.array([0.114, 0.587, 0.299])).astype(image.dtype)  # ITU-R BT.601, BGR
