# SPDX-License-Identifier: Apache-2.0
"""Provides DepthSensor, with the arguments, defaults and ranges of the published SimSense, on this engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._simsense import FAULTS, Camera, Device, Engine


class SettingError(ValueError, TypeError):
    """A setting is out of its range. It is a ValueError by its meaning, and a TypeError because SimSense raises
    that."""


def _require(condition: object, text: str) -> None:
    if not condition:
        raise SettingError(text)


def _is_int(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _require_numbers(**values: Any) -> None:
    for name, value in values.items():
        ok = isinstance(value, (int, float, np.number)) and not isinstance(value, bool) and np.isfinite(value)
        _require(ok, f"{name} must be a finite number, not {value!r}")


def _check_size(size: Sequence[int], what: str) -> tuple[int, int]:
    ok = np.ndim(size) == 1 and len(size) == 2 and all(_is_int(v) and v >= 32 for v in size)
    _require(ok, f"{what} must be (width, height), integers of at least 32, not {size}")
    return int(size[0]), int(size[1])


def _check_matrix(matrix: ArrayLike, side: int, what: str) -> NDArray[np.float64]:
    try:
        matrix = np.asarray(matrix, dtype=np.float64)
    except (TypeError, ValueError):
        raise SettingError(f"{what} is not a matrix of numbers") from None
    _require(matrix.shape == (side, side), f"{what} must be {side}x{side}, not {matrix.shape}")
    return matrix


def _check_window(width: int, height: int, largest: int, what: str) -> dict[str, Any]:
    ok = all(_is_int(v) and v > 0 and v % 2 == 1 for v in (width, height))
    ok = ok and width * height <= largest
    _require(ok, f"{what} must be odd, with a product of at most {largest}, not {width}x{height}")
    return {f"{what}_width": int(width), f"{what}_height": int(height)}


def _noise(shape: float, scale: float, mu: float, sigma: float) -> dict[str, Any]:
    _require_numbers(speckle_shape=shape, speckle_scale=scale, gaussian_mu=mu, gaussian_sigma=sigma)
    _require(shape >= 0, f"speckle_shape must not be negative, it is {shape}")
    if shape == 0:  # SimSense adds no noise at all then
        return {"speckle_shape": 0.0, "speckle_scale": 0.0, "black_level_dn": 0.0, "adc_noise_dn": 0.0}
    wanted = f"noise is on (speckle_shape {shape}): speckle_scale and gaussian_sigma must be positive"
    _require(scale > 0 and sigma > 0, f"{wanted}, not {scale} and {sigma}")
    return {"speckle_shape": shape, "speckle_scale": scale, "black_level_dn": mu, "adc_noise_dn": sigma}


def _penalties(p1: int, p2: int) -> dict[str, Any]:
    _require(
        _is_int(p1) and _is_int(p2) and 0 < p1 < p2 < 224,
        f"penalties must be integers with 0 < p1 < p2 < 224, not {p1} and {p2}",
    )
    return {"p1": int(p1), "p2": int(p2)}


def _uniqueness(ratio: int) -> dict[str, Any]:
    _require(_is_int(ratio) and 0 <= ratio <= 255, f"uniqueness_ratio must be an integer in 0..255, not {ratio}")
    return {"uniqueness_ratio": min(int(ratio), 100)}  # at 100 and above no match is unique enough


def _lr_max_diff(pixels: int) -> dict[str, Any]:
    _require(_is_int(pixels) and -1 <= pixels <= 255, f"lr_max_diff must be an integer in -1..255, not {pixels}")
    return {"lr_max_diff": -1 if pixels == 255 else int(pixels)}  # 255 and -1 switch the check off


class DepthSensor:
    """Computes depth from an infrared stereo pair.

    Sizes are (width, height); k_* are 3x3; l2r and l2rgb are 4x4 changes of frame from the left camera to the right and
    to the RGB camera, OpenCV axes. With rgb_size, k_rgb and l2rgb depth is registered to the RGB camera. min_depth,
    max_depth: metres. rectified: the pair is row-aligned already. lr_max_diff 255 and speckle_shape 0 switch their
    stage off. device: computes the depth ('host' needs no Vulkan). Raises SettingError (a ValueError and a TypeError)
    out of range.

    mode 'fixed' computes as the arguments are documented. 'simsense-exact' keeps SimSense's faults, its census of every
    count and its parabola as subpixel step. It gives SimSense's results bit for bit as long as noise is off: SimSense's
    random numbers are CUDA's, ours are drawn from the same distributions. faults: names out of simsense.FAULTS to keep
    instead of the mode's (none, or all); simsense/README.md explains each.
    """

    def __init__(
        self,
        lr_size: Sequence[int],
        k_l: ArrayLike,
        k_r: ArrayLike,
        l2r: ArrayLike,
        rgb_size: Sequence[int] | None = None,
        k_rgb: ArrayLike | None = None,
        l2rgb: ArrayLike | None = None,
        min_depth: float = 0.0,
        max_depth: float = 10.0,
        ir_noise_seed: int = 0,
        speckle_shape: float = 0.0,
        speckle_scale: float = 0.0,
        gaussian_mu: float = 0.0,
        gaussian_sigma: float = 0.0,
        rectified: bool = False,
        census_width: int = 7,
        census_height: int = 7,
        max_disp: int = 128,
        block_width: int = 7,
        block_height: int = 7,
        p1_penalty: int = 7,
        p2_penalty: int = 86,
        uniqueness_ratio: int = 15,
        lr_max_diff: int = 1,
        median_filter_size: int = 3,
        depth_dilation: bool = False,
        *,
        device: str | int | bytes | Device = "host",
        mode: Literal["fixed", "simsense-exact"] = "fixed",
        faults: Sequence[str] | None = None,
    ) -> None:
        width, height = _check_size(lr_size, "lr_size")
        _require(
            _is_int(max_disp) and 32 <= max_disp <= 1024, f"max_disp must be an integer in 32..1024, not {max_disp}"
        )
        _require(
            median_filter_size in (1, 3, 5, 7), f"median_filter_size must be 1, 3, 5 or 7, not {median_filter_size}"
        )
        _require_numbers(min_depth=min_depth, max_depth=max_depth)
        _require(
            0 <= min_depth < max_depth,
            f"depths must satisfy 0 <= min_depth < max_depth, not {min_depth} and {max_depth}",
        )
        _require(
            _is_int(ir_noise_seed) and ir_noise_seed >= 0,
            f"ir_noise_seed must be an integer of at least 0, not {ir_noise_seed}",
        )
        parameters: dict[str, Any] = {
            "min_depth_m": min_depth,
            "max_depth_m": max_depth,
            "noise_seed": int(ir_noise_seed),
            "max_disparity": int(max_disp),
            "median_size": int(median_filter_size),
            "depth_dilation": bool(depth_dilation),
            **_noise(speckle_shape, speckle_scale, gaussian_mu, gaussian_sigma),
            **_check_window(census_width, census_height, 65, "census"),
            **_check_window(block_width, block_height, 256, "block"),
            **_penalties(p1_penalty, p2_penalty),
            **_uniqueness(uniqueness_ratio),
            **_lr_max_diff(lr_max_diff),
        }
        _require(mode in ("fixed", "simsense-exact"), f"mode must be 'fixed' or 'simsense-exact', not {mode!r}")
        exact = mode == "simsense-exact"
        if exact:
            parameters |= {"subpixel": "parabola", "census_contrast": 0.0}
        left = Camera(width, height, _check_matrix(k_l, 3, "k_l"))
        right = Camera(width, height, _check_matrix(k_r, 3, "k_r"))
        rgb, l2rgb = self._rgb_camera(rgb_size, k_rgb, l2rgb)
        self._output = "depth" if rgb is None else "depth_rgb"
        self._size = (height, width)
        self._frame = 0
        device = device if isinstance(device, Device) else Device(device)
        l2r = _check_matrix(l2r, 4, "l2r")
        if faults is None:
            faults = FAULTS if exact else ()
        rig: dict[str, Any] = {"rgb": rgb, "left_to_rgb": l2rgb, "rectified": bool(rectified), "faults": faults}
        self._engine = Engine(device, left, right, l2r, **rig, **parameters)

    @staticmethod
    def _rgb_camera(
        size: Sequence[int] | None, k: ArrayLike | None, l2rgb: ArrayLike | None
    ) -> tuple[Camera | None, NDArray[np.float64] | None]:
        given = [value is not None for value in (size, k, l2rgb)]
        _require(all(given) or not any(given), "rgb_size, k_rgb and l2rgb go together: give all three or none")
        if size is None or k is None or l2rgb is None:
            return None, None
        width, height = _check_size(size, "rgb_size")
        return Camera(width, height, _check_matrix(k, 3, "k_rgb")), _check_matrix(l2rgb, 4, "l2rgb")

    @property
    def engine(self) -> Engine:
        """Returns the engine underneath, for its other outputs and parameters."""
        return self._engine

    def compute(self, img_l: NDArray[np.uint8], img_r: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Returns depth float32 [height, width] in metres, 0 = invalid, of the left or, if given, the RGB camera.
        img_l, img_r: uint8 [height, width], any strides. Each call has new noise."""
        for image, name in ((img_l, "img_l"), (img_r, "img_r")):
            ok = isinstance(image, np.ndarray) and image.dtype == np.uint8 and image.shape == self._size
            _require(ok, f"{name} must be a uint8 array of shape {self._size}")
        self._engine.set_parameters(frame_index=self._frame)
        self._frame += 1
        return self._engine.compute(img_l, img_r, (self._output,))[self._output]

    def set_ir_noise_parameters(
        self, speckle_shape: float, speckle_scale: float, gaussian_mu: float, gaussian_sigma: float
    ) -> None:
        """Sets the noise of the infrared images; speckle_shape 0 switches it off."""
        self._engine.set_parameters(**_noise(speckle_shape, speckle_scale, gaussian_mu, gaussian_sigma))

    def set_census_window_size(self, census_width: int, census_height: int) -> None:
        self._engine.set_parameters(**_check_window(census_width, census_height, 65, "census"))

    def set_matching_block_size(self, block_width: int, block_height: int) -> None:
        """Sets the block over which matching costs are summed, in pixels; 1x1 switches block matching off."""
        self._engine.set_parameters(**_check_window(block_width, block_height, 256, "block"))

    def set_penalties(self, p1_penalty: int, p2_penalty: int) -> None:
        self._engine.set_parameters(**_penalties(p1_penalty, p2_penalty))

    def set_uniqueness_ratio(self, uniqueness_ratio: int) -> None:
        self._engine.set_parameters(**_uniqueness(uniqueness_ratio))

    def set_lr_max_diff(self, lr_max_diff: int) -> None:
        """Sets the largest difference of the left-right check, in pixels of disparity; 255 switches the check off."""
        self._engine.set_parameters(**_lr_max_diff(lr_max_diff))
