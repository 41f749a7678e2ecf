# SPDX-License-Identifier: Apache-2.0
"""Other simulators: SAPIEN, ManiSkill, MuJoCo, URDF files and Gymnasium. Nothing else imports them."""
