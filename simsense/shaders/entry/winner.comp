// SPDX-License-Identifier: Apache-2.0
// Winners from means of any range.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/winner.glsl"
