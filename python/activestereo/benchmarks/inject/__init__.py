# SPDX-License-Identifier: Apache-2.0
"""Known effects put into the measured images of a capture, with formulas of their own: nothing of the lab's library of
effects is used here."""
