# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide a diagnosis, in one table. All other numbers of the package change its running time alone.

The unit "noise variances" is a mean squared residual divided by the mean noise variance (a reduced chi-square).
"""

from dataclasses import dataclass, field
from typing import Any


def _number(value: float, unit: str, decides: str) -> Any:
    return field(default=value, metadata={"unit": unit, "decides": decides})


@dataclass(frozen=True)
class Numbers:
    """The thresholds of a diagnosis; each field's metadata holds its unit and what it decides. A share is a part of the
    squared error that exceeds the noise."""

    # fmt: off
    # Thresholds for naming an effect.
    alpha: float = _number(0.01, "1", "probability of a name by chance among all shapes of all effects, and of "
        "the rig's correction beside geometry's names")
    least_share: float = _number(0.05, "1", "least share of the squared error above the noise that a name removes")
    least_excess: float = _number(0.007, "noise variances", "least fall of the mean square by a name: more "
        "than all but one of 333 captures that hide nothing; half of it where the residual has no structure")
    formula_error: float = _number(0.035, "1", "share of a name's gain that even rendered images or draws may miss: "
        "the unit of the odds in a set; a further name exceeds it, twice beside formulas, or what these may look like")
    credible: float = _number(0.95, "1", "probability that a set holds")
    prior_reach: float = _number(3.0, "typical values", "deviation of an amplitude's prior")
    most_names: int = _number(4, "1", "number of names that a search ends at, and the verdict is `unknown`")
    # Thresholds of the verdict.
    structure: float = _number(0.1, "noise variances", "structure beyond which something is missing where nothing is "
        "named, and which draws leave")
    structure_kept: float = _number(0.017, "noise variances", "the same beside a name: the structure that remains, "
        "times its share of a name's part of the first one")
    scene_error: float = _number(0.35, "noise variances", "excess that errors of the scene measurement leave, on train "
        "frames or on test frames")
    strain: float = _number(4.0, "1", "stated deviations by which a name may move the rig or an albedo, "
        "or two albedos be off without one")
    # Random draws, and the depth engine.
    neighbours: float = _number(0.4, "1", "correlation of neighbours above which values are no draws")
    outlier: float = _number(5.0, "1", "deviations by which a sparse draw, such as a hot pixel, stands out")
    engines_differ: float = _number(1.7, "1", "factor within which the differences of neighbouring disparities of two "
        "depth engines agree")
    poses_known_to_rad: float = _number(0.0025, "rad", "uncertainty of measured orientations, for the depth engine")
    # fmt: on


NUMBERS = Numbers()
