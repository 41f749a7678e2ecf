// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Built once for each band (KUAFU_CHANNELS): one ray per invocation, queues filled by workgroups.
#include "lib/invocation.glsl"
#include "lib/shading.glsl"

layout(push_constant, scalar) uniform Push { ShadePush push; };
#include "stage/shade.glsl"

/// No more than each vertex' shadow rays and its next ray can come of `count` rays.
void cover_next(uint block, uint count) {
  uint shadows = count * push.shadow_rays_per_vertex;
  cover_rays(push.counters, block + counter_shadow_arguments, shadows);
  cover(push.counters, block + counter_transmit_arguments, shadows);
  cover_rays(push.counters, block + counter_words + counter_trace_arguments, count);
  cover(push.counters, block + counter_words + counter_shade_arguments, count);
}

void main() {
  uint i = gl_GlobalInvocationID.x, block = push.bounce * counter_words, count = push.counters.at[block + counter_ray_count];
  bool live = i < count;
  if (i == 0u) cover_next(block, count);
  Shading shading;
  shading.hit = shading.fog.found = shading.walk.inside = false;
  if (live) shading = begin_shading(i);
  for (uint k = 0u; k < push.shadow_rays_per_vertex; ++k) {
    ShadowRequest request = no_shadow_request();
    if (live && asks_light(shading, k)) request = ask_light(shading, k);
    uint place = append(request.wanted, push.counters, block + counter_shadow_count);
    if (request.wanted) queue_shadow(shading.path, request, k, place);
    else if (live) queue_no_shadow(shading.path, k);
  }
  NextRequest next = no_next_request();
  if (live && goes_on(shading)) next = scatter(shading);
  block += counter_words;
  uint place = append(next.wanted, push.counters, block + counter_ray_count);
  if (next.wanted) queue_next(shading.path, next, place);
}
