# SPDX-License-Identifier: Apache-2.0
"""Adds frames to a world, as a user records them who follows the tool's advice or makes another choice."""

from dataclasses import replace

import numpy as np

from virtual_sensor.held_out.rig import random_pose

_PAUSE_S = 1.3
_SEED = 17
# What a user could do without advice: {name: change}, in the words of diagnose.json.
CHOICES = {
    "projector off": {"power_factor": 0.0},
    "quarter exposure": {"exposure_factor": 0.25},
    "double exposure": {"exposure_factor": 2.0},
    "half power": {"power_factor": 0.5},
    "warmer": {"warming_k": 20.0},
    "cooler": {"warming_k": -10.0},
    "sideways": {"velocity": [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]},
    "turning": {"velocity": [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]},
    "repeats": {"repeats": 2},
    "other views": {"views": 6},
}


def more_frames(frames, change):
    """Returns frames, then changed copies of the train views: change["repeats"] more, or change["views"] new poses."""
    if "views" in change:
        rng = np.random.Generator(np.random.PCG64([_SEED, len(frames)]))
        new = [replace(frames[0], camera_to_world=random_pose(rng), repeat_group=None) for _ in range(change["views"])]
        times = frames[-1].timestamp_s + _PAUSE_S * np.arange(1, len(new) + 1)
        return (
            *frames,
            *(
                replace(f, id=len(frames) + i, timestamp_s=float(t))
                for i, (f, t) in enumerate(zip(new, times, strict=True))
            ),
        )
    views, seen = [], set()
    for frame in frames:
        view = frame.camera_to_world.tobytes(), frame.exposure_s, frame.power, frame.temperature_c, frame.twist
        if frame.split == "train" and view not in seen:
            seen.add(view)
            views.append(frame)
    out, time_s = list(frames), frames[-1].timestamp_s
    group = 1 + max((f.repeat_group for f in frames if f.repeat_group is not None), default=-1)
    for frame in views:
        for _ in range(change.get("repeats", 1)):
            time_s += _PAUSE_S
            new = replace(_changed(frame, change), id=len(out), timestamp_s=time_s, repeat_group=None)
            if "repeats" in change:
                if frame.repeat_group is None:
                    frame = replace(frame, repeat_group=group)
                    out[frame.id], group = frame, group + 1
                new = replace(new, repeat_group=frame.repeat_group)
            out.append(new)
    return tuple(out)


def _changed(frame, change):
    return replace(
        frame,
        power=frame.power * change.get("power_factor", 1.0),
        exposure_s=frame.exposure_s * change.get("exposure_factor", 1.0),
        temperature_c=frame.temperature_c + change["warming_k"] if "warming_k" in change else frame.temperature_c,
        twist=tuple(change["velocity"]) if "velocity" in change else frame.twist,
    )
