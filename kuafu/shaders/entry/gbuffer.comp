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

void main() {
  uint i = line_index();
  if (i < push.count) gbuffer_step(i);
}
