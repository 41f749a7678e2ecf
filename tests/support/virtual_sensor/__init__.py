# SPDX-License-Identifier: Apache-2.0
"""Records worlds with a known answer by numerics of its own; the product is judged on the files alone."""
