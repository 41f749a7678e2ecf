# SPDX-License-Identifier: Apache-2.0
"""Converts simulators' images (G-buffers) to the arguments of GBufferStereo. Each simulator has a file of its own.

    sensor = GBufferStereo(config, environments=E)
    look = NewtonGBuffers(model, sensor)  # or MujocoWarpGBuffers, MujocoGBuffers, ...
    depth_m = sensor(**look(state, camera_to_world))["depth"]

The simulator's camera needs the left infrared camera's pose and its matrix, sensor.k. If the simulator only knows a
field of view, make the sensor from centred(config).
"""
