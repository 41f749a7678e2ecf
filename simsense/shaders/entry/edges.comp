// SPDX-License-Identifier: Apache-2.0
// No measurement beside a step of disparity or at the right image's edges (cpu/checks/checks.h): pixels are marked, then dropped.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/clean.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

const uint stays = 0u, outside = 1u, at_step = 2u;

uint mark(int x, int y, uint first_pixel) {
  float d = push.disparity.at[first_pixel + uint(y) * push.width + uint(x)];
  if (d == push.invalid) return stays;
  float match = float(x) - d, border = float(push.max_size);
  if (push.max_size > 0u && (match < border || match > float(push.width) - 1.0f - border)) return outside;
  if (!(push.max_diff_px > 0.0f)) return stays;
  for (int v = max(0, y - 1); v <= min(int(push.height) - 1, y + 1); ++v)
    for (int u = max(0, x - 1); u <= min(int(push.width) - 1, x + 1); ++u) {
      float other = push.disparity.at[first_pixel + uint(v) * push.width + uint(u)];
      if (other != push.invalid && abs(other - d) > push.max_diff_px) return at_step;
    }
  return stays;
}

void main() {
  int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
  if (x >= int(push.width) || y >= int(push.height)) return;
  uint first_pixel = gl_WorkGroupID.z * push.width * push.height;
  uint pixel = first_pixel + uint(y) * push.width + uint(x);
  if (push.step == EDGES_PASS_MARK)
    push.parent.at[pixel] = mark(x, y, first_pixel);
  else if (push.parent.at[pixel] != stays)
    drop(pixel, push.parent.at[pixel] == outside ? REASON_OUTSIDE : REASON_NOT_UNIQUE);
}
