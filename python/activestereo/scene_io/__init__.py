# SPDX-License-Identifier: Apache-2.0
"""Scenes: files that are read, converted and written; solids and bodies of which scenes are made."""
