# SPDX-License-Identifier: Apache-2.0
"""Cameras as data: figures of real cameras (data), a sensor's configuration from them, and what both engines are told
of it.
"""
