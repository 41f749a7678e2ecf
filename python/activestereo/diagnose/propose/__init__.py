# SPDX-License-Identifier: Apache-2.0
"""Where fits start: coarse scans of an effect's parameters, the effect's own proposals, and the surfaces that show
it.
"""
