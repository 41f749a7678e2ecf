// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"

layout(push_constant, scalar) uniform Push { AovPush push; };
#include "stage/visibility.glsl"

void main() {
  if (gl_GlobalInvocationID.x < push.range.pixel_count) visibility(gl_GlobalInvocationID.x);
}
