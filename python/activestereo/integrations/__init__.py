# SPDX-License-Identifier: Apache-2.0
"""Bridges to other simulators and formats: SAPIEN, ManiSkill, MuJoCo, RealSense's API, URDF files and Gymnasium.
Nothing else in activestereo imports them."""
