# SPDX-License-Identifier: Apache-2.0
"""Diagnoses a capture: which physical effect does its sensor model lack?

evidence   measured images beside their rendered light, with noise and tiles
search     scores all effects, fits the few that matter, gives the verdict
channels   judges effects that expected images do not show: random fields, noise, the device's depth
refine     fits effect parameters and nuisances
score      turns fits into gains of log-likelihood, intervals and remaining structure
answer     writes the diagnosis as data
diagnosis.py runs these in order; numbers.py holds every number that decides.
"""

from activestereo.diagnose.diagnosis import Diagnosis, Settings, diagnose, examine

__all__ = ["Diagnosis", "Settings", "diagnose", "examine"]
