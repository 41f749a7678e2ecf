# SPDX-License-Identifier: Apache-2.0
"""The worlds: three modes of our simulation (activestereo.sensor.depth_modes), and the foreign one."""

SIMULATED = ("clean", "raster", "full")
FOREIGN = ("sensor", "mitsuba")  # worlds that stand for reality: of our renderer, or of another project's
WORLDS = (*SIMULATED, "foreign")
