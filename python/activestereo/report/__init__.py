# SPDX-License-Identifier: Apache-2.0
"""Writes reports for people: pictures and browser pages of comparisons, diagnoses and simulated frames."""
