# SPDX-License-Identifier: Apache-2.0
"""Scenes of USD (.usd, .usda, .usdc, .usdz) as glTF, by the package usd-core where it is installed.

    convert    a stage becomes one .glb file, in metres with y up, or part of a kuafu.Scene
    stage      opens a stage; units, axes, what is seen
    shapes     meshes and their subsets as triangles
    surfaces   UsdPreviewSurface as glTF's materials
    lamps      distant, sphere, rectangle, disk and dome lights

What of a stage is not converted gives a message under the logger `activestereo.scene_io.usd`, once for each kind.
"""

from activestereo.scene_io.usd.convert import Converted, UsdError, convert, is_usd, load_usd

__all__ = ["Converted", "UsdError", "convert", "is_usd", "load_usd"]
