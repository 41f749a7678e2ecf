# SPDX-License-Identifier: Apache-2.0
"""The standard library's tomllib, which Python 3.10 has by the name of the package it was made from."""

import sys

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["tomllib"]
