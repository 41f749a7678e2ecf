// SPDX-License-Identifier: Apache-2.0
// No measurement where a rectified pixel lies outside its source image (cpu/checks/checks.h).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/clean.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

void main() {
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y;
  if (x >= push.width || y >= push.height) return;
  uint at = y * push.width + x;
  float sx = push.x.at[at], sy = push.y.at[at];
  bool inside = sx >= 0.0f && sy >= 0.0f && sx <= float(push.width - 1u) && sy <= float(push.height - 1u);
  if (!inside) drop(gl_WorkGroupID.z * push.width * push.height + at, REASON_NOT_COMPUTED);
}
