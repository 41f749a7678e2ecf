// SPDX-License-Identifier: Apache-2.0
// Causes behind an invalid pixel: measured but out of range; and of what the stages rejected, whatever the left image itself explains.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/depth.glsl"
#include "shared/map_push.h"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { ReasonPush push; };

uint explained(DepthParameters p, uint reason, int x, int y, uint n) {
  int reach_x = int(push.window_width / 2u), reach_y = int(push.window_height / 2u);
  uint darkest = 0xffffffffu, brightest = 0u, saturated = 0u, cells = 0u;
  for (int v = max(0, y - reach_y); v <= min(int(p.height) - 1, y + reach_y); ++v)
    for (int u = max(0, x - reach_x); u <= min(int(p.width) - 1, x + reach_x); ++u) {
      uint value = uint(load_element(push.left, element_of(push.left, n, uint(u), uint(v))));
      darkest = min(darkest, value);
      brightest = max(brightest, value);
      saturated += uint(value >= push.saturated_dn);
      ++cells;
    }
  if (2u * saturated >= cells) return REASON_SATURATED;
  return brightest - darkest <= push.low_texture_dn ? REASON_LOW_TEXTURE : reason;
}

void main() {
  DepthParameters p = push.block.parameters;
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (x >= p.width || y >= p.height) return;
  uint at = (n * p.height + y) * p.width + x, reason = uint(push.reason.at[at]);
  if (reason == REASON_VALID && keep(p, depth_of(p, push.disparity.at[at])) == 0.0f) reason = REASON_OUT_OF_RANGE;
  if (MAY_BE_EXPLAINED(reason)) reason = explained(p, reason, int(x), int(y), n);
  push.reason.at[at] = uint8_t(reason);
}
