# SPDX-License-Identifier: Apache-2.0
"""Matchers beside each other on simulated pairs by material, with the projector on, off and in turn; a small network,
and how it is trained."""
