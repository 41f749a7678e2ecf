# SPDX-License-Identifier: Apache-2.0
"""Lists the bars for the benchmark suite's measures: the direction, the value to ship, the world-class value."""

BARS = {
    "top-1": (">=", 0.85, 0.92),
    "top-3": (">=", 0.95, 0.98),
    "family": (">=", 0.95, 0.98),
    "equivalence set holds the truth": (">=", 0.95, 0.97),
    "equivalence set size (median)": ("<=", 2, 1),
    "false alarms": ("<=", 0.05, 0.02),
    "outside the library: said so": (">=", 0.8, 0.9),
    "outside the library: wrong name": ("<=", 0.1, 0.05),
    "pairs: both found": (">=", 0.75, 0.85),
    "parameter error (median)": ("<=", 0.10, 0.05),
    "90 % intervals hold the truth": (">=", 0.85, 0.88),
    "calibration error (ECE)": ("<=", 0.07, 0.04),
    "error fall F (median)": (">=", 0.8, 0.9),
    "next measurement resolves": (">=", 0.7, 0.85),
    "seconds per diagnosis (median)": ("<=", 45, 45),
    "depth alone is undetermined": (">=", 1.0, 1.0),
}
