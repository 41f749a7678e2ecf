# SPDX-License-Identifier: Apache-2.0
"""Feeds simulators' own images to GBufferStereo. Each simulator has a small file, which imports no other.

    sensor = GBufferStereo(config, environments=E)
    look = NewtonGBuffers(model, sensor)  # or MujocoWarpGBuffers, MujocoGBuffers, ...
    depth_m = sensor(**look(state, camera_to_world))["depth"]

The simulator's camera stands in the left infrared camera's place and has its matrix, sensor.k. A simulator with only a
field of view takes centred(config).
"""
