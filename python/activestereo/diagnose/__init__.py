# SPDX-License-Identifier: Apache-2.0
"""Diagnoses a capture: which physical effect does its sensor model lack?

gather, geometry_search    measured images beside their rendered light, at the poses that fit
dictionary, linear, selection, refit, search    scores all effects, fits the few that matter, names them
fields, noise, depth_engine    judge what expected images do not show: random fields, noise, the device's depth
pixels, fitter, goodness    fit parameters and nuisances, and tell what a fit is worth
verdict, ranking, figures, found_model, words    the answer
diagnosis.py runs these in order; numbers.py holds every number that decides.
"""

from activestereo.diagnose.diagnosis import Diagnosis, Settings, diagnose, examine

__all__ = ["Diagnosis", "Settings", "diagnose", "examine"]
