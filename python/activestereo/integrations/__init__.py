# SPDX-License-Identifier: Apache-2.0
"""Other simulators: SAPIEN, ManiSkill, MuJoCo and URDF files. Nothing else imports them."""
