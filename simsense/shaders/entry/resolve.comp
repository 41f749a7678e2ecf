// SPDX-License-Identifier: Apache-2.0
// What the RGB camera sees: each point covers splat_size x splat_size pixels about its own. Depth (first) and points (second), which have a
// colour where an RGB image (third) is given.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/depth.glsl"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { DepthPush push; };

float resolved_depth(DepthParameters p, uint n, uint x, uint y) {
  int first_x = int(x) + SPLAT_MARGIN - int(p.splat_reach), first_y = int(y) + SPLAT_MARGIN - int(p.splat_reach);
  uint bits = infinity;
  for (int v = 0; v < int(p.splat_size); ++v)
    for (int u = 0; u < int(p.splat_size); ++u) bits = min(bits, push.nearest.at[cell_at(p, n, first_x + u, first_y + v)]);
  return bits == infinity ? 0.0f : keep(p, uintBitsToFloat(bits));
}

void main() {
  DepthParameters p = push.block.parameters;
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (x >= p.rgb_width || y >= p.rgb_height) return;
  float z = resolved_depth(p, n, x, y);
  if (push.first.format != 0u) store_depth(push.first, element_of(push.first, n, x, y), z);
  if (push.second.format == 0u) return;
  uint point = element_of(push.second, n, x, y), color = element_of(push.third, n, x, y);
  store_point(p, push.second, point, x, y, p.rgb_width, z);
  if (push.third.format == 0u) return;
  for (uint c = 0u; c < 3u; ++c)
    store_f32(push.second, point + (3u + c) * uint(push.second.component_stride),
              z > 0.0f ? exact_quotient(load_element(push.third, color + c * uint(push.third.component_stride)), 255.0f) : 0.0f);
}
