# SPDX-License-Identifier: Apache-2.0
"""Measures a real camera and a room from views with depth, without wall, board or repeats. world.py has the steps."""
