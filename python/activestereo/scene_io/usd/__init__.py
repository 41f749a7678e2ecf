# SPDX-License-Identifier: Apache-2.0
"""Converts USD scenes (.usd, .usda, .usdc, .usdz) to glTF with the package usd-core, if it is installed.

    convert    converts a stage to one .glb file, in metres with y up, or adds it to a kuafu.Scene
    stage      opens a stage; its unit, axes and values
    shapes     meshes and their subsets as triangles
    surfaces   UsdPreviewSurface as glTF's materials
    lamps      distant, sphere, rectangle, disk and dome lights

Each kind of content that is not converted gives one message under the logger `activestereo.scene_io.usd`."""

from activestereo.scene_io.usd.convert import Converted, UsdError, convert, is_usd, load_usd

__all__ = ["Converted", "UsdError", "convert", "is_usd", "load_usd"]
