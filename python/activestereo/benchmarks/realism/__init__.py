# SPDX-License-Identifier: Apache-2.0
"""Measures how far several kinds of simulated depth are from a real camera's recordings: `activestereo benchmark
realism`."""
