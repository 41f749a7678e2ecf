# SPDX-License-Identifier: Apache-2.0
"""Simulates worlds with a known answer: an analytic ray caster, random numbers and numerics that share nothing with the
product.

A virtual sensor records a world in the capture format. The product is then judged on the files alone.
"""
