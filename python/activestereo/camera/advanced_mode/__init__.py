# SPDX-License-Identifier: Apache-2.0
"""Reads, checks and writes the D400's advanced-mode JSON, and converts it to parameters of the matcher and the
camera."""

from activestereo.camera.advanced_mode.settings import (
    AdvancedSettings,
    DepthTable,
    camera_fields,
    depth_table,
    matcher_parameters,
    read_settings,
    write_settings,
)
