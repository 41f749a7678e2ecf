# SPDX-License-Identifier: Apache-2.0
"""The parts that effects are made of: descriptors, light, view, model, laws, and the operations that several effects
share."""
