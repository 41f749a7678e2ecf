# SPDX-License-Identifier: Apache-2.0
"""Reads, converts and writes scene files, and makes the solids and bodies of which scenes consist."""

# Endings of the scene files that kuafu reads, and of those that usd-core converts for it.
OWN_ENDINGS = (".gltf", ".glb", ".obj", ".dae", ".stl", ".ply")
USD_ENDINGS = (".usd", ".usda", ".usdc", ".usdz")
