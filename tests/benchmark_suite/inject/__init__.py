# SPDX-License-Identifier: Apache-2.0
"""Adds known effects to the measured images of a capture, with separate formulas: it uses nothing of the lab's library
of effects."""
