# SPDX-License-Identifier: Apache-2.0
"""Reads, converts and writes scene files, and makes the solids and bodies of which scenes consist."""
