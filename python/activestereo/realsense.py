# SPDX-License-Identifier: Apache-2.0
"""Offers pyrealsense2's names for a simulated camera: write `import activestereo.realsense as rs` in place of `import
pyrealsense2 as rs`. integrations/realsense/README.md lists the names that exist."""

from activestereo.integrations.realsense import *  # noqa: F403
from activestereo.integrations.realsense import __getattr__  # noqa: F401
