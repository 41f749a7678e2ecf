// SPDX-License-Identifier: Apache-2.0
// Registration: each measured pixel is a point that lands on the nearest pixel of the RGB camera; the nearest point stays. The arithmetic of
// cpu/registration/registration.cpp. Positive floats sort as their bits do.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/depth.glsl"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { DepthPush push; };

void main() {
  DepthParameters p = push.block.parameters;
  uint column = gl_GlobalInvocationID.x, row = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (column >= p.width || row >= p.height) return;
  float depth = depth_of(p, push.disparity.at[(n * p.height + row) * p.width + column]);
  if (!(depth > 0.0f) && p.splat_invalid == 0u) return;
  precise float seen[3];
  for (uint i = 0u; i < 3u; ++i) seen[i] = depth * (p.step[i] * float(column) + p.row_starts.at[3u * row + i]) + p.translation_m[i];
  if (!(seen[2] > 0.0f)) return;
  precise float x = exact_quotient(seen[0], seen[2]), y = exact_quotient(seen[1], seen[2]);
  if (p.lens.max_radius2 > 0.0f && !distort(p.lens, x, y)) return;
  precise float u = floor(p.rgb_focal[0] * x + p.rgb_centre[0] + 0.5f), v = floor(p.rgb_focal[1] * y + p.rgb_centre[1] + 0.5f);
  float m = p.landing_margin;
  if (!(u >= -m && v >= -m && u < float(p.rgb_width) + m && v < float(p.rgb_height) + m)) return;
  atomicMin(push.nearest.at[cell_at(p, n, int(u) + SPLAT_MARGIN, int(v) + SPLAT_MARGIN)], floatBitsToUint(seen[2]));
}
