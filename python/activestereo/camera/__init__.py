# SPDX-License-Identifier: Apache-2.0
"""Cameras as data: figures of real cameras (data), sensor configurations from them, and the engines' parameters."""
