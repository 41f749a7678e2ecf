# SPDX-License-Identifier: Apache-2.0
"""Compares simulated with real depth, fits other simulators' noise models, and makes data sets. Only the command line
imports these modules."""
