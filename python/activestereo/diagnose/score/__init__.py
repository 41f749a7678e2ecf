# SPDX-License-Identifier: Apache-2.0
"""Turns fits into evidence: log-likelihood gains, penalties for free parameters, intervals, and remaining structure."""
