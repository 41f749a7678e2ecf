# SPDX-License-Identifier: Apache-2.0
"""The variance that rounding to whole numbers adds to a value."""

# The variance of an error that is uniform over one step, in steps squared (Bennett 1948).
ROUNDING_VARIANCE = 1.0 / 12.0
