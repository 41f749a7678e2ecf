# SPDX-License-Identifier: Apache-2.0
"""The verdict that findings allow. All functions here are pure: they look at findings and thresholds, and at nothing
else."""
