# SPDX-License-Identifier: Apache-2.0
"""Benchmarks and data sets that use the sensor: sim_to_real, grasp, generate. Nothing but the command line imports
them.
"""
