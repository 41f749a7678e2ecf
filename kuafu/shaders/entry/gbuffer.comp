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

/// Lobes are rare, and take far longer than all else of a pixel: those pixels fill groups of their own. Weak ones, which get fewer rays, are
/// listed from the list's end on.
void bounce(uint i) {
  GbufferPlace p = gbuffer_place(min(i, push.count - 1u));
  bool later = i < push.count && has_lobes(i, p), weak = later && push.record.at[0].lobes.at[i] <= weak_lobes;
  uint place = append(later && !weak, push.record.at[0].lobe_pixels, 0u), weak_place = append(weak, push.record.at[0].lobe_pixels, 1u);
  if (later) push.record.at[0].lobe_pixels.at[weak ? push.count + 1u - weak_place : 2u + place] = i;
  else if (i < push.count) bounce_pixel(i, p);
}

void light_lobes(uint i) {
  uint strong = push.record.at[0].lobe_pixels.at[0], count = strong + push.record.at[0].lobe_pixels.at[1];
  for (uint k = i; i < push.count && k < count; k += push.count) {
    uint pixel = push.record.at[0].lobe_pixels.at[k < strong ? 2u + k : 2u * pixels_per_camera() + 1u + strong - k];
    bounce_pixel(pixel, gbuffer_place(pixel));
  }
}

void main() {
  uint i = line_index();
  if (step == gbuffer_bounce) bounce(i);
  else if (step == gbuffer_lobes) light_lobes(i);
  else if (i < push.count) gbuffer_step(i);
}
