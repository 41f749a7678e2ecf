# SPDX-License-Identifier: Apache-2.0
"""Converts USD scenes (.usd, .usda, .usdc, .usdz) to glTF with the package usd-core, if it is installed.

Each kind of content that is not converted gives one message under the logger `activestereo.scene_io.usd`."""

from activestereo.scene_io.usd.convert import Converted, UsdError, convert, is_usd, load_usd

__all__ = ["Converted", "UsdError", "convert", "is_usd", "load_usd"]
