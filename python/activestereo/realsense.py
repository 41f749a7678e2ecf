# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's names on a simulated camera: `import activestereo.realsense as rs` in place of `import pyrealsense2 as
rs`. integrations/realsense/README.md says what there is."""

from activestereo.integrations.realsense import *  # noqa: F403
from activestereo.integrations.realsense import __getattr__  # noqa: F401
