// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/camera.glsl"
#include "lib/pixel_sample.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"

layout(push_constant, scalar) uniform Push { GeneratePush push; };
#include "stage/generate.glsl"

void main() {
  uint slot = gl_GlobalInvocationID.x, paths = path_count();
  if (slot == 0u) {
    push.counters.at[counter_ray_count] = paths;
    cover_rays(push.counters, counter_trace_arguments, paths);
    cover(push.counters, counter_shade_arguments, paths);
  }
  if (slot < paths) generate(slot);
}
