# SPDX-License-Identifier: Apache-2.0
"""Counts of imagers for the light that falls on them, finer than in whole counts: simsense's signal chain in 16
bits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import simsense

_MOST_COUNTS = 2**16 - 1
# The expected value has no random part; a response and a full well act on the mean.
NOISE = (
    "speckle_shape",
    "prnu",
    "hot_pixel_share",
    "shot_noise",
    "dsnu_e",
    "row_fixed_e",
    "column_fixed_e",
    "row_noise_e",
    "column_noise_e",
    "read_noise_e",
    "adc_noise_dn",
)
_IN_COUNTS = ("conversion_gain_dn_per_e", "black_level_dn", "black_level_dn_per_k")


class ExpectedImager:
    """A pair of imagers of one image size. Counts are multiples of max_dn / 65535."""

    def __init__(self, width: int, height: int, max_dn: float) -> None:
        k = np.array([[width, 0.0, width / 2], [0.0, width, height / 2], [0.0, 0.0, 1.0]])
        camera, beside = simsense.Camera(width, height, k), np.eye(4)
        beside[0, 3] = -0.05  # any row-aligned pair: it is not matched
        self._engine = simsense.Engine(
            simsense.Device("host"), camera, camera, beside, rectified=True, back_end="cpu", bit_depth=16
        )
        self._scale = _MOST_COUNTS / max_dn

    def counts(
        self,
        images: Sequence[tuple[NDArray, NDArray | None]],
        signals: Sequence[dict[str, float]],
        frame_index: int | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """DN [height][width] of the left and the right camera: on average, or in one exposure where frame_index is
        given. images: all light and the laser's part of it (None: speckle is of all), in the signals' own unit."""
        fine = [self._fine(signal, frame_index is not None) for signal in signals]
        self._engine.set_parameters(frame_index=frame_index or 0)
        self._engine.set_signal(*fine)
        left, right = (pair[0].astype(np.float32) for pair in images)
        left_laser, right_laser = (None if pair[1] is None else pair[1].astype(np.float32) for pair in images)
        given = self._engine.compute(
            left, right, ("ir_left", "ir_right"), left_laser=left_laser, right_laser=right_laser
        )
        scale = np.float32(self._scale)
        return given["ir_left"].astype(np.float32) / scale, given["ir_right"].astype(np.float32) / scale

    def one(self, image: NDArray, signal: dict[str, float]) -> NDArray[np.float32]:
        """counts() of one imager on average."""
        return self.counts([(image, None)] * 2, [signal] * 2)[0]

    def _fine(self, signal: dict[str, float], noisy: bool) -> dict[str, float]:
        scaled = {name: signal[name] * self._scale for name in _IN_COUNTS}
        return signal | ({} if noisy else dict.fromkeys(NOISE, 0.0)) | scaled | {"bit_depth": 16}
