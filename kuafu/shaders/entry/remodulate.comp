// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#define KUAFU_CHANNELS 3
#include "lib/invocation.glsl"
#include "lib/alike.glsl"
#include "lib/material.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"

layout(push_constant, scalar) uniform Push { RemodulatePush push; };
#include "lib/planes.glsl"
#include "lib/guide.glsl"
#include "stage/blend.glsl"
#include "stage/remodulate.glsl"

shared float shares[gl_WorkGroupSize.x];

// One ray per invocation; the first of a pixel's adds up.
void main() {
  uint i = line_index(), place = gl_LocalInvocationIndex;
  if (push.blends != 0u) {
    if (i < push.count) blend(i);
    return;
  }
  bool live = i / square_rays < square_count();
  Gathered light;
  if (live) light = square_light(i);
  for (uint p = 0u; p < plane_count(); ++p) {
    shares[place] = live ? light.light[p] : 0.0f;
    barrier();
    if (live && i % square_rays == 0u) {
      float sum = 0.0f;
      for (uint s = 0u; s < square_rays; ++s) sum += shares[place + s];
      remodulate(square_pixel(i / square_rays), p, sum);
    }
    barrier();
  }
}
