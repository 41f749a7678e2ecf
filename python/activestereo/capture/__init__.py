# SPDX-License-Identifier: Apache-2.0
"""Captures: recordings of a real camera with the scene that it saw. capture.py reads them, write.py writes them, and
importers converts other programs' recordings."""
