# SPDX-License-Identifier: Apache-2.0
"""The depth sensor. One engine (engine.py) does the work; a sensor (sensor.py) and a batch (batch.py) are views of
it."""
