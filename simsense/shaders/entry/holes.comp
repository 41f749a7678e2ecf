// SPDX-License-Identifier: Apache-2.0
// Hole filling along rows (cpu/checks/checks.h) in two passes: each hole's guess beside the disparities, then over them.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/clean.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

/// The first valid disparity beside pixel x of the row, within the region; invalid where there is none.
float neighbour(uint row, uint x, int step) {
  for (int u = int(x) + step; u >= int(push.x0) && u < int(push.x1); u += step) {
    float disparity = push.disparity.at[row + uint(u)];
    if (disparity != push.invalid) return disparity;
  }
  return push.invalid;
}

float guess(uint row, uint x) {
  float left = neighbour(row, x, -1);
  if (push.filling != HOLES_BACKGROUND) return left;
  float right = neighbour(row, x, 1);
  return right == push.invalid ? left : left == push.invalid ? right : min(left, right);
}

void main() {
  uint x = push.x0 + gl_GlobalInvocationID.x, y = push.y0 + gl_GlobalInvocationID.y;
  if (x >= push.x1 || y >= push.y1) return;
  uint row = (gl_WorkGroupID.z * push.height + y) * push.width;
  if (push.disparity.at[row + x] != push.invalid) return;
  if (push.step == HOLES_PASS_GUESS) {
    push.parent.at[row + x] = floatBitsToUint(guess(row, x));
  } else {
    push.disparity.at[row + x] = uintBitsToFloat(push.parent.at[row + x]);
  }
}
