# SPDX-License-Identifier: Apache-2.0
"""Makes held-out test cases: captures of small table-top scenes by a virtual sensor with a hidden effect, and their
answer keys.

Shares no code with the product: closed-form intersections, radiosity on charts instead of path tracing, PCG64 instead
of Philox, float64, its own file writers and depth engine. Hidden effects have formulas of their own as far as physics
allows. The order of the light: scene -> emitter -> surface -> camera -> optics -> imager -> depth. One module each.
"""
