# SPDX-License-Identifier: Apache-2.0
"""Camera data with sources (folder data), the sensor configurations made from them, and the engines' parameters."""
