# SPDX-License-Identifier: Apache-2.0
"""Compares simulated with real depth, and makes data sets. Only the command line imports these modules."""
