# SPDX-License-Identifier: Apache-2.0
"""Adds known effects to the measured images of a capture, by formulas that the lab's library does not share."""
