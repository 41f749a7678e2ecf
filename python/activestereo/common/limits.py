# SPDX-License-Identifier: Apache-2.0
"""Allowed ranges of numbers that users give in captures, sensor configurations and setters."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from activestereo.common.shown import shown

_LARGEST = sys.float_info.max


@dataclass(frozen=True)
class Limits:
    """An allowed range: finite numbers from low to high; with `whole`, whole numbers only. unit: for messages. slip:
    how to convert from the unit that is likely meant beyond the range."""

    low: float
    high: float
    unit: str = ""
    whole: bool = False
    slip: str = ""

    def fault(self, value: Any) -> str | None:
        """Returns None if the value is allowed. Otherwise returns the fault as text that follows the value's name."""
        kind = "a whole" if self.whole else "a finite"
        is_number = isinstance(value, Integral if self.whole else Real) and not isinstance(value, bool)
        if not is_number or not -_LARGEST <= value <= _LARGEST:  # nor NaN, nor a whole number beyond a float's range
            return f"is {shown(value)}, expected {kind} number, {self}"
        if not self.low <= value <= self.high:
            slip = f" ({self.slip})" if self.slip else ""
            return f"is {shown(value)}, expected {self}: correct the value or its unit{slip}"
        return None

    def check(self, name: str, value: Any) -> Any:
        """Returns the value if it is allowed. Raises ValueError with the name and the fault otherwise."""
        if (fault := self.fault(value)) is not None:
            raise ValueError(f"{name} {fault}")
        return value

    def check_each(self, name: str, values: ArrayLike, count: int) -> NDArray[np.float64]:
        """Checks one number for each of `count` simulation environments, or one for all, and returns [count] numbers.
        Raises ValueError with the name and the environment."""
        numbers = np.asarray(values, np.float64)
        if numbers.shape not in ((), (count,)):
            raise ValueError(f"{name} is {list(numbers.shape)}, expected a number or [{count}]")
        for n, value in enumerate(np.atleast_1d(numbers).tolist()):
            self.check(f"{name} of environment {n}" if numbers.shape else name, value)
        return np.broadcast_to(numbers, (count,))

    def __str__(self) -> str:
        low, high = (str(int(end)) if self.whole else f"{end:g}" for end in (self.low, self.high))
        return f"{low} to {high} {self.unit}".rstrip()


# Limits of sensors, lamps and views: wider than any real one, and far from float32's ends. Where another unit is usual,
# its numbers are beyond them: a camera on a car has 50 m/s, one that is turned by hand 20 rad/s, and a D400 exposes for
# 0.2 s at most, of which the number in milliseconds is 200.
ANY = Limits(-1e30, 1e30)
# Standard deviations of stated numbers, in metres, radians or shares; none is smaller than 1e-7.
UNCERTAINTY = Limits(1e-7, 1.0)
BLACK = Limits(-65535.0, 65535.0, "DN")
BLACK_DEVIATION = Limits(1e-4, 65535.0, "DN")
SPEED = Limits(-60.0, 60.0, "m/s", slip="divide mm/s by 1000")
TURN_RATE = Limits(-60.0, 60.0, "rad/s", slip="divide degrees/s by 57.3")
EXPOSURE = Limits(1e-9, 2.0, "s", slip="divide milliseconds by 1000, microseconds by 1e6")
GAIN = Limits(1e-9, 1e6)
POWER = Limits(0.0, 1e6)
TEMPERATURE = Limits(-100.0, 200.0, "degrees Celsius", slip="subtract 273.15 from kelvin")
FACTOR = Limits(0.0, 100.0, slip="it is a factor on the configured value")
LASER = Limits(0.5, 1e6, "mW", slip="multiply watts by 1000")
TIME = Limits(-1e12, 1e12, "s")
LENGTH = Limits(-1e7, 1e7, "m")
RADIUS = Limits(0.0, 1e4, "m")
DEPTH_SCALE = Limits(1e-9, 10.0, "m per unit of the depth image")
LINE_TIME = Limits(-1.0, 1.0, "s")
SIDE = Limits(1, 65535, "px", whole=True)
FOCAL = Limits(1e-3, 1e6, "px")
PIXEL = Limits(-1e6, 1e6, "px")
DISTORTION = Limits(-1e4, 1e4)
BITS = Limits(1, 16, "bits", whole=True)
# JSON keeps whole numbers up to here (RFC 8259, section 6).
NUMBER = Limits(-(2**53), 2**53, whole=True)


def camera_matrix_fault(k: NDArray[np.float64]) -> str | None:
    """Returns None if k, [3, 3], is a camera matrix. Otherwise returns the fault as text that follows its name."""
    is_one = np.isfinite(k).all() and min(k[0, 0], k[1, 1]) >= FOCAL.low and k[1, 0] == 0.0
    if is_one and np.array_equal(k[2], [0.0, 0.0, 1.0]):
        return None
    return f"is no camera matrix [fx s cx, 0 fy cy, 0 0 1] with focal lengths of {FOCAL}"
