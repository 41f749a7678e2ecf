// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#define KUAFU_CHANNELS 1
#include "lib/invocation.glsl"
#include "lib/frame.glsl"
#include "lib/pattern_mean.glsl"
#include "lib/pixels.glsl"
#include "lib/reflected.glsl"
#include "shared/gbuffer_record.h"

layout(push_constant, scalar) uniform Push { GbufferPush push; };
layout(constant_id = 4) const uint step = gbuffer_read;
#include "stage/gbuffer.glsl"
#include "stage/gbuffer_warp.glsl"
#include "stage/gbuffer_bounce.glsl"
#include "stage/gbuffer_lobes.glsl"
#include "stage/gbuffer_blend.glsl"

/// Lobes are rare, and take far longer than all else of a pixel: those pixels fill groups of their own.
void bounce(uint i) {
  GbufferPlace p = gbuffer_place(min(i, push.count - 1u));
  bool later = i < push.count && has_lobes(i, p);
  uint place = append(later, push.record.at[0].lobe_pixels, 0u);
  if (later) push.record.at[0].lobe_pixels.at[1u + place] = i;
  else if (i < push.count) bounce_pixel(i, p);
}

void main() {
  uint i = line_index();
  if (step == gbuffer_bounce) bounce(i);
  else if (step == gbuffer_lobes) {
    uint count = push.record.at[0].lobe_pixels.at[0];
    for (uint k = i; i < push.count && k < count; k += push.count) {
      uint pixel = push.record.at[0].lobe_pixels.at[1u + k];
      bounce_pixel(pixel, gbuffer_place(pixel));
    }
  } else if (i < push.count) gbuffer_step(i);
}
