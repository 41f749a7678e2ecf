// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Built once for each band (KUAFU_CHANNELS): one beam per invocation.
#include "lib/invocation.glsl"
#include "lib/shading.glsl"

layout(push_constant, scalar) uniform Push { BeamPush push; };
#include "stage/follow.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x, block = push.block * counter_words, count = push.counters.at[block + counter_ray_count];
  block += counter_words;
  if (i == 0u) {
    cover_rays(push.counters, block + counter_trace_arguments, count);
    cover(push.counters, block + counter_shade_arguments, count);
  }
  Segment onward;
  onward.wanted = false;
  if (i < count) onward = follow_beam(i);
  uint place = append(onward.wanted, push.counters, block + counter_ray_count);
  if (onward.wanted) queue_beam(onward, place);
}
