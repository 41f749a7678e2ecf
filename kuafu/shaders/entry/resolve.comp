// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/queue.glsl"

layout(push_constant, scalar) uniform Push { ResolvePush push; };
#include "stage/resolve.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < push.counters.at[push.bounce * counter_words + counter_ray_count]) resolve(i);
}
