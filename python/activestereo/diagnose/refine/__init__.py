# SPDX-License-Identifier: Apache-2.0
"""Fits parameters: weighted least squares in the effects' parameters and the nuisances together."""

from activestereo.diagnose.refine.fitter import Fitter, ImageResidual
from activestereo.diagnose.refine.parameter_space import ParameterSpace, Solution

__all__ = ["Fitter", "ImageResidual", "ParameterSpace", "Solution"]
