# SPDX-License-Identifier: Apache-2.0
"""The search that scores all effects first and fits the few that matter (loop.py)."""
