// SPDX-License-Identifier: Apache-2.0
// Winners from means and disparities that fit 16 bits together: where the device has half floats.
#version 460
#extension GL_GOOGLE_include_directive : require
#define PACKED_KEYS
#include "lib/winner.glsl"
