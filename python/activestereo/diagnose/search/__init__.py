# SPDX-License-Identifier: Apache-2.0
"""Searches for missing effects: scores all of them first, then fits the few that matter (loop.py)."""
