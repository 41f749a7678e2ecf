# SPDX-License-Identifier: Apache-2.0
"""Makes held-out test cases: captures of small table-top scenes by a virtual sensor with a hidden effect, and their
answer keys.

Shares no code with the product. It uses closed-form intersections, radiosity on charts instead of path tracing, PCG64
instead of Philox, and float64. File writers, depth engine and, as far as physics allows, the hidden effects' formulas
are its own.

The order of the light: scene -> emitter -> surface -> camera -> optics -> imager -> depth. One module each. In all of
them `hidden` is {effect: {parameter: value}}, and `side` is "left" or "right".
"""
