// SPDX-License-Identifier: Apache-2.0
// Ray against triangle by edge functions (Davidovic et al., "3D Rasterization: A Bridge between Rasterization and Ray Casting", 2012).
// Two triangles that share an edge evaluate it on the same numbers with opposite sign, so no ray slips between them.
#ifndef KUAFU_BVH_TRIANGLE_GLSL
#define KUAFU_BVH_TRIANGLE_GLSL

#include "shared/bvh_node.h"

/// Twice the signed volume that the edge from p to q spans with the direction, all seen from the ray's origin.
float edge_function(vec3 p, vec3 q, vec3 direction) {
  precise vec3 moment = cross(q - p, q + p);
  precise float side = dot(moment, direction);
  return side;
}

/// A hit in [t_near, t_far] shortens t_far and gives the barycentrics (u, v) of vertices 1 and 2. Both faces count.
bool hit_triangle(BvhTriangle triangle, vec3 origin, vec3 direction, float t_near, inout float t_far, inout vec2 uv) {
  vec3 a = triangle.v0 - origin, b = triangle.v1 - origin, c = triangle.v2 - origin;
  vec3 weights = vec3(edge_function(b, c, direction), edge_function(c, a, direction), edge_function(a, b, direction));
  float low = min(min(weights.x, weights.y), weights.z), high = max(max(weights.x, weights.y), weights.z);
  if (low < 0.0 && high > 0.0) return false;
  vec3 normal = cross(b - a, c - a);
  float t = dot(normal, a) / dot(normal, direction);
  if (!(t >= t_near && t <= t_far)) return false;  // false as well for a degenerate triangle, whose t is not a number
  float sum = weights.x + weights.y + weights.z;
  if (sum == 0.0) return false;
  t_far = t;
  uv = weights.yz / sum;
  return true;
}

#endif
