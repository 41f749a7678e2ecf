"""Measured, simulated and residual pictures of the report: infrared and depth, of the frame that fails most in each split."""

import numpy as np

from activestereo.capture import SPLITS
from activestereo.lab.html import picture

# The residual scale ends here, in noise floors: white noise stays pale, a failing model shows.
RESIDUAL_FLOORS = 4.0
_LEAST_DISPARITY_SCALE_PX = 0.5


def infrared_pictures(comparison):
    """HTML: a row of three pictures per split, left eye."""
    rows = []
    for split in SPLITS:
        if split not in comparison.scores["ir"]:
            continue
        entry = worst_frame(comparison.scores, split)
        frame = next(f for f in comparison.capture.frames if f.id == entry["id"])
        measured = comparison.capture.ir(frame, "left")
        predicted = comparison.predictions[frame.id, "left"]
        high, limit = float(np.quantile(measured, 0.998)), RESIDUAL_FLOORS * (entry["noise_floor_dn"] or entry["rmse_dn"])
        name = f"{split}, frame {frame.id}, left: "
        rows += [
            picture(measured, 0.0, high, "gray", name + "measured", "DN", power=0.5),
            picture(predicted, 0.0, high, "gray", "simulated", "DN", power=0.5),
            picture(measured - predicted, -limit, limit, "RdBu_r", "measured − simulated", "DN"),
        ]
    return f'<div class="pictures">{"".join(rows)}</div>'


def depth_pictures(comparison):
    """HTML: device depth, model depth and their difference in disparity; '' without device depth."""
    rows = []
    for split, scores in comparison.scores["depth"].items():
        entry = _worst(scores["frames"], "rmse_px", "rmse_px")
        depth = next(d for d in comparison.depths if d.frame.id == entry["id"])
        error, valid = depth.disparity_error(depth.measured, depth.model[0])
        seen = depth.truth[depth.truth > 0]
        low, high = (float(q) for q in np.quantile(seen, (0.01, 0.99))) if seen.size else (0.0, 1.0)
        limit = max(_LEAST_DISPARITY_SCALE_PX, RESIDUAL_FLOORS * (scores["noise_floor_median_abs_px"] or 0.0))
        rows += [
            picture(depth.measured, low, high, "viridis", f"{split}, frame {entry['id']}: device", "m", empty=depth.measured <= 0),
            picture(depth.model[0], low, high, "viridis", "model", "m", empty=depth.model[0] <= 0),
            picture(error, -limit, limit, "RdBu_r", "device − model, disparity", "px", empty=~valid),
        ]
    return f'<div class="pictures">{"".join(rows)}</div>' if rows else ""


def worst_frame(scores, split):
    """The entry of scores["frames"] whose infrared error stands out most."""
    return _worst([e for e in scores["frames"] if e["split"] == split], "explainable_rmse_dn", "rmse_dn")


def _worst(entries, key, otherwise):
    """The frame whose error stands furthest above its floor (or is largest, where there is no floor)."""
    return max(entries, key=lambda e: (e[otherwise] if e[key] is None else e[key]) or 0.0)
