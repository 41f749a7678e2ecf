# SPDX-License-Identifier: Apache-2.0
"""Measures the distance of kinds of simulated depth from a real camera's recordings: `activestereo benchmark
realism`."""
