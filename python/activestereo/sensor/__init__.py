# SPDX-License-Identifier: Apache-2.0
"""The depth sensor: one (sensor.py), a batch (batch.py), a batch over several devices (split_batch.py), and one whose
result is one picture late (pipelined.py; of a batch, an option).
"""
