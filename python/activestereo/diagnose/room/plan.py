# SPDX-License-Identifier: Apache-2.0
"""Recordings by which effects can be told: each with the effects that it tells and the minutes that it takes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Recording:
    """One recording of a plan: what to do, the minutes that it takes, and the effects that it tells."""

    text: str
    minutes: float
    tells: tuple[str, ...]


# The order follows evidence per minute of a prototype on a D415's views; it is not measured anew for a recording.
PLAN = (
    Recording(
        "turn the camera by 15 degrees between three views of a still room, exposure fixed", 2.0,
        ("vignetting", "gain_mismatch", "row_noise", "flicker_banding", "tangential_distortion", "focus_mismatch"),
    ),
    Recording(
        "roll the camera by 90 degrees at one of these places", 1.0,
        ("flicker_banding", "lens_ghost", "veiling_glare", "tangential_distortion", "radial_distortion"),
    ),
    Recording(
        "one view at twice the exposure time, nothing moved, both times stated", 1.0,
        ("response_gamma", "saturation_blooming", "gain_error"),
    ),
    Recording("cover the lenses and record twenty frames", 1.0, ("black_level", "dark_signal", "fixed_pattern_noise",
                                                                 "hot_pixels")),
    Recording("twenty frames of one view, nothing moved", 1.0, ("shot_noise", "read_noise", "quantisation", "prnu")),
    Recording("the same views with the projector off", 2.0, ("dot_gain_spread", "projector_defocus", "haze",
                                                             "second_projector", "external_light")),
    Recording(
        "the first recording again when the unit is known to be good: give it as --reference", 2.0,
        ("lens_psf", "stereo_pitch", "stereo_roll", "pattern_scale_drift", "baseline_drift", "thermal_drift",
         "double_image", "response_gamma", "veiling_glare"),
    ),
)  # fmt: skip


def recordings_for(effects: Iterable[str]) -> list[tuple[Recording, tuple[str, ...]]]:
    """The fewest recordings of the plan, in its order, that tell effects, each with those that it is for."""
    left, out = set(effects), []
    for recording in PLAN[1:]:
        own = tuple(name for name in recording.tells if name in left)
        if own:
            out.append((recording, own))
            left -= set(own)
    return out


def plan_text() -> str:
    """The whole plan, a line each."""
    lines = [f"{n}. {r.text} ({r.minutes:g} min): {', '.join(r.tells)}" for n, r in enumerate(PLAN, 1)]
    return "\n".join([*lines, f"{sum(r.minutes for r in PLAN):g} minutes in all"])
