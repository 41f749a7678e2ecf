// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Built once for each band (KUAFU_CHANNELS): beams leave their lights, one per invocation.
#include "lib/invocation.glsl"
#include "lib/shading.glsl"

layout(push_constant, scalar) uniform Push { BeamPush push; };
#include "stage/follow.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i == 0u) {
    push.counters.at[counter_ray_count] = push.count;
    cover_rays(push.counters, counter_trace_arguments, push.count);
    cover(push.counters, counter_shade_arguments, push.count);
  }
  if (i < push.count) send_beam(i);
}
