# SPDX-License-Identifier: Apache-2.0
"""Gathers the evidence of a diagnosis: measured images beside their rendered light, expected variances and tiles."""

from activestereo.diagnose.evidence.gather import gather
from activestereo.diagnose.evidence.geometry import Geometry
from activestereo.diagnose.evidence.observation import BLOCK_PX, TILE_PX, Evidence, Observation

__all__ = ["BLOCK_PX", "TILE_PX", "Evidence", "Geometry", "Observation", "gather"]
