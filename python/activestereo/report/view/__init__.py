# SPDX-License-Identifier: Apache-2.0
"""A local page that shows captures, scenes and recordings, and renders them again as its sliders move: `activestereo
view`."""
