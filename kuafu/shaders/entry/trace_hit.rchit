// SPDX-License-Identifier: Apache-2.0
#version 460
// The nearest hit, into the payload.
#extension GL_GOOGLE_include_directive : require
#include "lib/rt_hit.glsl"

layout(location = 0) rayPayloadInEXT RtHit hit;
hitAttributeEXT vec2 barycentrics;

void main() { hit = RtHit(gl_HitTEXT, barycentrics, gl_PrimitiveID, gl_InstanceCustomIndexEXT); }
