# SPDX-License-Identifier: Apache-2.0
"""Compares captures with the simulator: expected images, noise, and statistics of the differences in images and
depth."""
