# SPDX-License-Identifier: Apache-2.0
"""Opens a stage with usd-core, reads its values, unit and axes, and gives each message once."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

_LOG = logging.getLogger("activestereo.scene_io.usd")


class UsdError(ValueError):
    """Raised if a USD file cannot be shown. The message has the file and the remedy."""


@dataclass
class Stage:
    """An open stage at one time, with the messages about it."""

    path: Path
    stage: Any  # Usd.Stage
    time: Any  # Usd.TimeCode
    messages: list[str] = field(default_factory=list)

    def tell(self, message: str) -> None:
        """Logs and keeps a message, unless it was given before."""
        if message not in self.messages:
            self.messages.append(message)
            _LOG.warning("%s: %s", self.path, message)

    def value(self, attribute: Any, fallback: Any = None) -> Any:
        """Returns an attribute's value at the stage's time, or `fallback` if it has none."""
        value = attribute.Get(self.time) if attribute else None
        return fallback if value is None else value

    def vectors(self, attribute: Any, size: int = 3) -> np.ndarray:
        """Returns an attribute's vectors [n, size]; [0, size] without a value. A value of another kind also gives [0,
        size], with a message."""
        value = self.value(attribute)
        if value is None:
            return np.empty((0, size))
        try:
            out = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            out = np.empty(0)
        if out.shape != (len(out) if out.ndim else 0, size):
            self.tell(f"{attribute.GetPath()} is left out: it is no array of vectors of {size} numbers")
            return np.empty((0, size))
        return out

    def to_metres(self) -> np.ndarray:
        """Returns the 4x4 from the stage's axes and unit to metres with y up."""
        from pxr import UsdGeom

        # UsdGeom.GetStageMetersPerUnit takes doubles alone, and some exporters write a float.
        authored = self.stage.GetPseudoRoot().GetMetadata(UsdGeom.Tokens.metersPerUnit)
        scale = float(UsdGeom.LinearUnits.centimeters if authored is None else authored)
        out = np.diag([scale, scale, scale, 1.0])
        if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z:
            out = out @ np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
        return out


def open_stage(path: Path, time_s: float | None) -> Stage:
    """Opens a stage at a time: seconds after its start, or None for each attribute's earliest sample. Raises
    UsdError."""
    try:
        from pxr import Tf, Usd
    except ImportError as error:
        raise UsdError(
            f"{path}: USD is read by the package usd-core, which is missing: pip install usd-core, or export glTF"
        ) from error
    if not path.is_file():
        raise UsdError(f"{path}: there is no such file")
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise UsdError(f"{path}: is no USD file that can be read: {cause(error)}") from error
    # EarliestTime also reads attributes without samples. Usd.TimeCode.Default would miss those with samples only.
    if time_s is None:
        return Stage(path, stage, Usd.TimeCode.EarliestTime())
    return Stage(path, stage, Usd.TimeCode(stage.GetStartTimeCode() + time_s * stage.GetTimeCodesPerSecond()))


def cause(error: Exception) -> str:
    """Returns the first text that one of Pixar's errors quotes; they begin with their own source lines."""
    quoted = [line.split(" : '", 1)[1].rstrip("'") for line in str(error).splitlines() if " : '" in line]
    return quoted[0] if quoted else "its errors say nothing"


def columns(matrix: Any) -> np.ndarray:
    """Converts a Gf.Matrix4d, which multiplies row vectors, to a 4x4 that multiplies column vectors."""
    return np.array(matrix, dtype=float).T
