# SPDX-License-Identifier: Apache-2.0
"""Data beside expected images that effects are judged on: draws that stay, temporal noise, the device's depth."""
