# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide a diagnosis. The table at the end of README.md says what each decides, and its unit. All
other numbers of the package change its running time alone.

The unit "noise variances" is a mean squared residual divided by the mean noise variance (a reduced chi-square). A share
is a part of the squared error that exceeds the noise.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Numbers:
    """The thresholds of a diagnosis: for naming an effect, of the verdict, of random draws and of the depth engine."""

    alpha: float = 0.01
    least_share: float = 0.05
    least_excess: float = 0.007
    formula_error: float = 0.035
    credible: float = 0.95
    prior_reach: float = 3.0
    most_names: int = 4

    structure: float = 0.1
    structure_kept: float = 0.017
    scene_error: float = 0.35
    strain: float = 4.0

    neighbours: float = 0.4
    outlier: float = 5.0
    engines_differ: float = 1.7
    poses_known_to_rad: float = 0.0025


NUMBERS = Numbers()
