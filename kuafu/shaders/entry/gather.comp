// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Built once for each band (KUAFU_CHANNELS): one vertex per invocation.
#include "lib/invocation.glsl"
#include "lib/shading.glsl"

layout(push_constant, scalar) uniform Push { ShadePush push; };
#include "stage/shade.glsl"
#include "stage/gather.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.counters.at[push.bounce * counter_words + counter_ray_count]) return;
  Gathering g = begin_gathering(i);
  if (g.wanted) gather(i, g);
}
