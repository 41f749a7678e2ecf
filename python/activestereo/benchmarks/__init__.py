# SPDX-License-Identifier: Apache-2.0
"""Comparisons of simulated with real depth, and data sets. Nothing but the command line imports them."""
