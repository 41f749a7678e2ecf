# SPDX-License-Identifier: Apache-2.0
"""Provides DepthSensor, with the arguments and defaults of the published SimSense, on this engine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._simsense import FAULTS, ArgumentError, Camera, Device, Engine

# The engine's names of SimSense's settings that differ from them.
_NAMES = {
    "min_depth": "min_depth_m", "max_depth": "max_depth_m", "ir_noise_seed": "noise_seed", "max_disp": "max_disparity",
    "gaussian_mu": "black_level_dn", "gaussian_sigma": "adc_noise_dn", "p1_penalty": "p1", "p2_penalty": "p2",
    "median_filter_size": "median_size",
}  # fmt: skip


class SettingError(ValueError, TypeError):
    """A setting is out of its range. It is a ValueError by its meaning, and a TypeError because SimSense raises
    that."""


@contextmanager
def _checked(what: str) -> Iterator[None]:
    """Converts the engine's errors inside the block to a SettingError, whose text begins with `what`."""
    try:
        yield
    except (ArgumentError, TypeError, ValueError) as error:
        raise SettingError(f"{what}: {str(error).splitlines()[0]}") from error


def _camera(size: Sequence[int], k: ArrayLike, name: str) -> Camera:
    with _checked(f"camera {name}, of a size (width, height) of integers and a 3x3"):
        width, height = size
        return Camera(width, height, np.asarray(k, np.float64))


def _parameters(**settings: Any) -> dict[str, Any]:
    """Converts settings by SimSense's names and conventions to the engine's parameters."""
    out = {_NAMES.get(name, name): value for name, value in settings.items()}
    if out.get("speckle_shape") == 0:  # SimSense adds no noise at all then
        out |= dict.fromkeys(("speckle_shape", "speckle_scale", "black_level_dn", "adc_noise_dn"), 0.0)
    if out.get("uniqueness_ratio") in range(101, 256):  # from 100 on no match is unique enough
        out["uniqueness_ratio"] = 100
    if out.get("lr_max_diff") == 255:
        out["lr_max_diff"] = -1
    return out


class DepthSensor:
    """Computes depth from an infrared stereo pair.

    Sizes are (width, height); k_* are 3x3; l2r and l2rgb are 4x4 changes of frame from the left camera to the right and
    to the RGB camera, OpenCV axes. With rgb_size, k_rgb and l2rgb depth is registered to the RGB camera. min_depth,
    max_depth: metres. rectified: the pair is row-aligned already. lr_max_diff 255 and speckle_shape 0 switch their
    stage off. device: computes the depth ('host' needs no Vulkan). Raises SettingError (a ValueError and a TypeError)
    with the engine's words for a value out of range.

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
        if mode not in ("fixed", "simsense-exact"):
            raise SettingError(f"mode must be 'fixed' or 'simsense-exact', not {mode!r}")
        exact, given = mode == "simsense-exact", [value is not None for value in (rgb_size, k_rgb, l2rgb)]
        if any(given) and not all(given):
            raise SettingError("rgb_size, k_rgb and l2rgb go together: give all three or none")
        rgb = None if rgb_size is None or k_rgb is None else _camera(rgb_size, k_rgb, "rgb")
        left, right = _camera(lr_size, k_l, "left"), _camera(lr_size, k_r, "right")
        self._output = "depth" if rgb is None else "depth_rgb"
        self._size = tuple(lr_size)[::-1]
        self._frame = 0
        parameters = _parameters(
            min_depth=min_depth, max_depth=max_depth, ir_noise_seed=ir_noise_seed, speckle_shape=speckle_shape,
            speckle_scale=speckle_scale, gaussian_mu=gaussian_mu, gaussian_sigma=gaussian_sigma,
            census_width=census_width, census_height=census_height, max_disp=max_disp, block_width=block_width,
            block_height=block_height, p1_penalty=p1_penalty, p2_penalty=p2_penalty, uniqueness_ratio=uniqueness_ratio,
            lr_max_diff=lr_max_diff, median_filter_size=median_filter_size, depth_dilation=bool(depth_dilation),
        )  # fmt: skip
        if exact:
            parameters |= {"subpixel": "parabola", "census_contrast": 0.0}
        if faults is None:
            faults = FAULTS if exact else ()
        rig: dict[str, Any] = {"rgb": rgb, "left_to_rgb": l2rgb, "rectified": bool(rectified), "faults": faults}
        device = device if isinstance(device, Device) else Device(device)
        with _checked("settings"):
            self._engine = Engine(device, left, right, np.asarray(l2r, np.float64), **rig, **parameters)

    @property
    def engine(self) -> Engine:
        """Returns the engine underneath, for its other outputs and parameters."""
        return self._engine

    def compute(self, img_l: NDArray[np.uint8], img_r: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Returns depth float32 [height, width] in metres, 0 = invalid, of the left or, if given, the RGB camera.
        img_l, img_r: uint8 [height, width], any strides. Each call has new noise."""
        for image, name in ((img_l, "img_l"), (img_r, "img_r")):
            if not (isinstance(image, np.ndarray) and image.dtype == np.uint8 and image.shape == self._size):
                raise SettingError(f"{name} must be a uint8 array of shape {self._size}")
        self._engine.set_parameters(frame_index=self._frame)
        self._frame += 1
        return self._engine.compute(img_l, img_r, (self._output,))[self._output]

    def _set(self, **settings: Any) -> None:
        with _checked("settings"):
            self._engine.set_parameters(**_parameters(**settings))

    def set_ir_noise_parameters(
        self, speckle_shape: float, speckle_scale: float, gaussian_mu: float, gaussian_sigma: float
    ) -> None:
        """Sets the noise of the infrared images; speckle_shape 0 switches it off."""
        noise = {"gaussian_mu": gaussian_mu, "gaussian_sigma": gaussian_sigma}
        self._set(speckle_shape=speckle_shape, speckle_scale=speckle_scale, **noise)

    def set_census_window_size(self, census_width: int, census_height: int) -> None:
        self._set(census_width=census_width, census_height=census_height)

    def set_matching_block_size(self, block_width: int, block_height: int) -> None:
        """Sets the block over which matching costs are summed, in pixels; 1x1 switches block matching off."""
        self._set(block_width=block_width, block_height=block_height)

    def set_penalties(self, p1_penalty: int, p2_penalty: int) -> None:
        self._set(p1_penalty=p1_penalty, p2_penalty=p2_penalty)

    def set_uniqueness_ratio(self, uniqueness_ratio: int) -> None:
        self._set(uniqueness_ratio=uniqueness_ratio)

    def set_lr_max_diff(self, lr_max_diff: int) -> None:
        """Sets the largest difference of the left-right check, in pixels of disparity; 255 switches the check off."""
        self._set(lr_max_diff=lr_max_diff)
