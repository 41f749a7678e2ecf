// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/pixels.glsl"

layout(push_constant, scalar) uniform Push { AccumulatePush push; };
#include "stage/accumulate.glsl"

void main() {
  if (gl_GlobalInvocationID.x < push.range.pixel_count) accumulate(gl_GlobalInvocationID.x);
}
