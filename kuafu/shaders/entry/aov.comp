// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Built once for each band (KUAFU_CHANNELS): one pixel per invocation.
#include "lib/invocation.glsl"
#include "lib/camera.glsl"
#include "lib/material.glsl"
#include "lib/motion_vector.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"
#include "lib/projector_view.glsl"

layout(push_constant, scalar) uniform Push { AovPush push; };
#include "stage/aov.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i == 0u && (push.flags & aov_visibility) != 0u) {
    push.counters.at[counter_shadow_count] = push.range.pixel_count;
    cover_rays(push.counters, counter_shadow_arguments, push.range.pixel_count);
  }
  if (i < push.range.pixel_count) aov(i);
}
