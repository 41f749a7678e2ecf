// SPDX-License-Identifier: Apache-2.0
// What each pixel's disparity becomes: disparity (first) and depth (second) in the caller's formats, points of the left camera (third).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/depth.glsl"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { DepthPush push; };

void main() {
  DepthParameters p = push.block.parameters;
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (x >= p.width || y >= p.height) return;
  float disparity = push.disparity.at[(n * p.height + y) * p.width + x], z = keep(p, depth_of(p, disparity));
  if (push.first.format != 0u) store_disparity(push.first, element_of(push.first, n, x, y), disparity);
  if (push.second.format != 0u) store_depth(push.second, element_of(push.second, n, x, y), z);
  if (push.third.format != 0u) store_point(p, push.third, element_of(push.third, n, x, y), x, y, p.width, z);
}
