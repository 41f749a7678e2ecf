# SPDX-License-Identifier: Apache-2.0
"""One decision from stored findings: models are compared by what the data say of each, and nothing else."""
