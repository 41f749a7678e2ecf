// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/element.glsl"
#include "lib/invocation.glsl"
#include "lib/pixels.glsl"

layout(push_constant, scalar) uniform Push { WritePush push; };
#include "stage/write.glsl"

void main() {
  uint i = line_index();
  if (i < push.count) write_pixel(i);
}
