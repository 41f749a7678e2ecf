# SPDX-License-Identifier: Apache-2.0
"""The geometry in a diagnosis: views, projector and focal lengths that differ from the stated ones, in numbers and
words."""

from typing import Any

import numpy as np

from activestereo.capture.capture import SIDES
from activestereo.diagnose.answer.verdict_words import beyond_stated
from activestereo.diagnose.evidence.geometry import TWIST, Geometry

# A correction is reported if it exceeds so many standard errors.
_TOLD_SIGMAS = 3.0


def geometry_json(geometry: Geometry) -> list[dict[str, Any]]:
    """Returns [{what, text, the correction, its standard errors}] of corrections that exceed their errors. Focal
    lengths have relative changes; the projector and views have moves in mm and turns in degrees. stated_sigmas: the
    largest correction of a coordinate in stated deviations."""
    if geometry.is_as_stated():
        return []
    known = geometry.stated.uncertainty
    focal, twists = np.split(geometry.deviations, [len(SIDES)])
    entries = [
        _focal(side, change, deviation, known.focal)
        for side, change, deviation in zip(SIDES, geometry.focal, focal, strict=True)
    ]
    moved = np.vstack([geometry.projector, geometry.poses])
    for row, (twist, deviations) in enumerate(zip(moved, twists.reshape(-1, TWIST), strict=True)):
        frames = None if row == 0 else geometry.frames_of(row - 1)
        stated = (known.projector_m, known.projector_rad) if row == 0 else (known.pose_m, known.pose_rad)
        entries.append(_place(frames, twist, deviations, np.repeat(stated, TWIST // 2)))
    return [entry for entry in entries if entry is not None]


def _focal(side: str, change: float, deviation: float, stated: float) -> dict[str, Any] | None:
    if abs(change) <= _TOLD_SIGMAS * deviation:
        return None
    sigmas = abs(change) / stated
    which = "longer" if change > 0 else "shorter"
    text = f"the {side} camera's focal length is {100 * abs(change):.2f} % {which} than the capture says"
    return {
        "what": f"focal_{side}",
        "text": text + beyond_stated(sigmas),
        "relative": float(change),
        "relative_sigma": float(deviation),
        "stated_sigmas": float(sigmas),
    }


def _place(
    frames: list[int] | None, twist: np.ndarray, deviations: np.ndarray, stated: np.ndarray
) -> dict[str, Any] | None:
    if not (np.abs(twist) > _TOLD_SIGMAS * deviations).any():
        return None
    moved_mm, turned_deg = 1e3 * float(np.linalg.norm(twist[:3])), float(np.degrees(np.linalg.norm(twist[3:])))
    sigmas, by = float(np.abs(twist / stated).max()), f"{moved_mm:.1f} mm ({turned_deg:.2f} degrees)"
    name = "the projector" if frames is None else f"the camera of frame {', '.join(map(str, frames))}"
    return {
        "what": "projector" if frames is None else "view",
        "text": f"{name} stands {by} from where the capture says{beyond_stated(sigmas)}",
        "frames": frames or [],
        "moved_mm": moved_mm,
        "turned_deg": turned_deg,
        "twist": twist.tolist(),
        "twist_sigma": deviations.tolist(),
        "stated_sigmas": sigmas,
    }
