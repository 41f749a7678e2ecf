# SPDX-License-Identifier: Apache-2.0
"""Converts USD scenes (.usd, .usda, .usdc, .usdz) to glTF with the package usd-core, if it is installed.

    convert    converts a stage to one .glb file, in metres with y up, or adds it to a kuafu.Scene
    shapes     opens a stage, and converts meshes and their subsets to triangles
    surfaces   converts UsdPreviewSurface to glTF's materials, and lights of all kinds but dome lights

Each kind of content that is not converted gives one message under the logger `activestereo.scene_io.usd`."""

from activestereo.scene_io.usd.convert import Converted, UsdError, convert, is_usd, load_usd

__all__ = ["Converted", "UsdError", "convert", "is_usd", "load_usd"]
