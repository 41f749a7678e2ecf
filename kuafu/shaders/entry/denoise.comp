// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/alike.glsl"

layout(push_constant, scalar) uniform Push { DenoisePush push; };
#include "lib/planes.glsl"
#include "stage/denoise.glsl"

void main() {
  uint i = line_index();
  if (i < push.count) denoise(i);
  if (denoise_step() != denoise_divide || push.lists == 0u) return;
  bool listed = i < push.count && push.pixels_out.at[i].square != square_plain;
  uint place = append(listed, push.squares, 0u);
  if (listed) push.squares.at[1u + place] = i;
}
