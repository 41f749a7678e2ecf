# SPDX-License-Identifier: Apache-2.0
"""Adds known effects to the measured images of a capture. Its formulas are its own and share nothing with the lab's
library of effects."""
