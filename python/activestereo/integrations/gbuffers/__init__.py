# SPDX-License-Identifier: Apache-2.0
"""Images that simulators render themselves, for GBufferStereo: a small file for each, which imports no other.

    sensor = GBufferStereo(config, environments=E)
    look = NewtonGBuffers(model, sensor)  # or MujocoWarpGBuffers, MujocoGBuffers, ...
    depth_m = sensor(**look(state, camera_to_world))["depth"]

The simulator's camera stands where the left infrared camera is and has its matrix, sensor.k; a simulator that knows
a field of view alone takes centred(config).
"""
