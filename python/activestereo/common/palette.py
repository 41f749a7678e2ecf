# SPDX-License-Identifier: Apache-2.0
"""The colours of reports and plots."""

INK, MUTED, GRID = "#1f2933", "#66727f", "#e4e7eb"
BLUE, ORANGE, GREEN = "#3e6fb0", "#c8722c", "#3f8f6b"
