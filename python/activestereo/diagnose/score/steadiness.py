# SPDX-License-Identifier: Apache-2.0
"""Errors that differ between frames, which a constant error of the scene measurement does not cause.

A misplaced surface or a wrong albedo causes the same error in every frame of a view, and about as much structure in
every image. An error of one frame of a view, or of one image, comes from an effect of time, temperature or motion, even
where it is lost in the mean of all images.
"""

from collections.abc import Sequence

import numpy as np

from activestereo.diagnose.refine.fitter import ImageResidual
from activestereo.diagnose.score.structure import image_structure


def unsteady_reduced_chi2(rows: Sequence[ImageResidual]) -> float:
    """By how much more one frame of a view differs from the others of that view than another frame does, in noise
    variances; 0 where no view has three frames.

    The error that all frames of a view share cancels in the differences, whatever its size.
    """
    views: dict[object, list[ImageResidual]] = {}
    for row in rows:
        f = row.observation.frame
        if not f.is_moving:
            light = f.exposure_gain, f.projector_power, f.ambient
            views.setdefault((f.camera_to_world.tobytes(), *light, row.observation.side), []).append(row)
    spans = [np.ptp([_apart(row, view) for row in view]) for view in views.values() if len(view) > 2]
    return float(max(spans, default=0.0))


def _apart(row: ImageResidual, view: Sequence[ImageResidual]) -> float:
    """Mean square of the difference from the mean of the view's other frames, in units of its variance."""
    others = [other for other in view if other is not row]
    difference = row.residual - np.mean([other.residual for other in others], axis=0)
    with np.errstate(divide="ignore"):  # the weight is 0 where the scene is not known
        variance = 1.0 / row.observation.weight + sum(1.0 / o.observation.weight for o in others) / len(others) ** 2
    return float((difference**2 / variance).mean())


def uneven_structure(rows: Sequence[ImageResidual]) -> float:
    """The largest structure of one image beyond the median image's, in noise variances."""
    structures = [image_structure(row) for row in rows]
    return float(max(structures) - np.median(structures))
