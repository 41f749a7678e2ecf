# SPDX-License-Identifier: Apache-2.0
"""The D400's visual presets as advanced-mode settings."""

from pathlib import Path

from activestereo.camera.advanced_mode.settings import AdvancedSettings, parse_settings
from activestereo.common.input_files import read_toml
from activestereo.common.nearest import unknown

_FILE = Path(__file__).with_name("presets.toml")
_EMPTY = ("custom", "default")


def visual_preset(name: str) -> AdvancedSettings:
    """The settings of a preset, by librealsense's name: custom, default, hand, high_accuracy, high_density or
    medium_density. ValueError lists them."""
    if name in _EMPTY:
        return AdvancedSettings({})
    known = read_toml(_FILE)
    if name not in known:
        raise ValueError(unknown("visual preset", name, [*_EMPTY, *known]))
    return parse_settings(known[name], name)
