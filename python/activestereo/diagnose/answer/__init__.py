# SPDX-License-Identifier: Apache-2.0
"""Writes a diagnosis as data: errors, ranking, the model found, and a formula of the error that no effect explains."""
