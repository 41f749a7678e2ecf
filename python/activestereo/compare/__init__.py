# SPDX-License-Identifier: Apache-2.0
"""Compares captures with the simulator: expected images, noise, statistics of the differences and of depth."""
