// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/pixels.glsl"
#include "shared/srgb_record.h"

layout(push_constant, scalar) uniform Push { SrgbPush push; };
#include "stage/srgb.glsl"

void main() {
  uint i = line_index();
  if (i < push.count) srgb(i);
}
