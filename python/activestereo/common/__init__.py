# SPDX-License-Identifier: Apache-2.0
"""Parts that every other package may use: rigid motions, lenses, the projector's pattern, generated tables of
parameters, output files.
"""
