// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/pixels.glsl"
#include "shared/denoise_record.h"

layout(push_constant, scalar) uniform Push { MomentsPush push; };
#include "stage/moments.glsl"

void main() {
  if (gl_GlobalInvocationID.x < push.count) moments(gl_GlobalInvocationID.x);
}
