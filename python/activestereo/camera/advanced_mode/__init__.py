# SPDX-License-Identifier: Apache-2.0
"""The D400's advanced-mode JSON: read, checked, written, and as parameters of the matcher and of the camera."""

from activestereo.camera.advanced_mode.settings import (
    AdvancedSettings,
    DepthTable,
    camera_fields,
    depth_table,
    matcher_parameters,
    read_settings,
    write_settings,
)
