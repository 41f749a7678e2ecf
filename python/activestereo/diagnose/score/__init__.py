# SPDX-License-Identifier: Apache-2.0
"""From fits to evidence: log-likelihood gains, what freedom costs, intervals, and what an explanation leaves."""
