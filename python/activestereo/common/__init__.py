# SPDX-License-Identifier: Apache-2.0
"""Parts that every other package may use, such as rigid motions, lenses, projector patterns, tables of the engines'
parameters and output files."""
