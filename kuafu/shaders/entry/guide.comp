// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#define KUAFU_CHANNELS 3
#include "lib/invocation.glsl"
#include "lib/alike.glsl"
#include "lib/material.glsl"
#include "lib/motion_vector.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"
#include "shared/denoise_record.h"

layout(push_constant, scalar) uniform Push { GuidePush push; };
#include "lib/guide.glsl"
#include "lib/history.glsl"
#include "stage/guide.glsl"

void main() {
  if (gl_GlobalInvocationID.x < push.count) guide(gl_GlobalInvocationID.x);
}
