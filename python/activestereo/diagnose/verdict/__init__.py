# SPDX-License-Identifier: Apache-2.0
"""What findings allow to say. All functions here are pure: they look at findings and thresholds, and at nothing
else."""
