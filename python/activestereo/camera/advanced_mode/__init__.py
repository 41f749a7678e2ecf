# SPDX-License-Identifier: Apache-2.0
"""Reads, checks and writes the D400's advanced-mode JSON, and converts it to parameters of the matcher and the
camera."""
