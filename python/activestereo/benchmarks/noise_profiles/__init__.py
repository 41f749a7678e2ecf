# SPDX-License-Identifier: Apache-2.0
"""The weaker noise models of other simulators, fitted to a sensor by simulating it, in those simulators' own files."""
