# SPDX-License-Identifier: Apache-2.0
"""Fits the simpler noise models of other simulators to a simulated sensor, and writes them as those simulators' own
files."""
