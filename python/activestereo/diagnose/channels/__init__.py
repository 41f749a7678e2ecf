# SPDX-License-Identifier: Apache-2.0
"""Judges effects by data that expected images lack: lasting random fields, temporal noise, the device's depth."""
