# SPDX-License-Identifier: Apache-2.0
"""The depth sensor: one engine (engine.py) of which a sensor (sensor.py) and a batch (batch.py) are views."""
