# SPDX-License-Identifier: Apache-2.0
"""Defines the parts that effects are made of: descriptors, light, view, model, laws, and operations that several
effects share."""
