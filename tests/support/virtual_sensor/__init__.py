# SPDX-License-Identifier: Apache-2.0
"""Worlds with a known answer: an analytic ray caster, random numbers and numerics that share nothing with the product.

A world is captured by a virtual sensor into the capture format; the product is then judged on the files alone.
"""
