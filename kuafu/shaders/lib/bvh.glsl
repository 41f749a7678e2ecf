// Traversal of the two-level BVH2: one ray, near child first, a stack of child codes. The layout is shared/bvh_node.h.
#ifndef KUAFU_BVH_GLSL
#define KUAFU_BVH_GLSL

#include "lib/bvh_triangle.glsl"
#include "lib/motion.glsl"
#include "shared/bvh_node.h"

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer BvhNodes { BvhNode node[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer BvhTriangles { BvhTriangle triangle[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer BvhInstances { BvhInstance instance[]; };

layout(constant_id = 2) const bool rays_have_time = false;  // some instance moves

const uint bvh_world = 0xffffffffu;  // "instance" while the ray is in the top level

struct BvhRay {
  vec3 origin;
  float t_near;
  vec3 direction;
  float t_far;  // shortened to the hit
  float time_s;
};

struct BvhHit {
  vec2 uv;
  uint primitive, instance;
};

/// Keeps the slab test free of 0 * infinity; an exactly parallel ray then counts as inside a slab that it touches.
vec3 bvh_inverse(vec3 direction) {
  const float least = 1e-20;
  return 1.0 / mix(direction, vec3(least), lessThan(abs(direction), vec3(least)));
}

/// Where the ray is inside a box: (enter, leave), empty when enter > leave.
/// The far side is widened by the rounding of three operations (Ize, "Robust BVH Ray Traversal", 2013), so that flat boxes are not missed.
vec2 bvh_span(vec4 xy, vec2 z, vec3 origin, vec3 inverse, float t_near, float t_far) {
  const float widen = 1.00000036;
  vec4 t_xy = (xy - origin.xxyy) * inverse.xxyy;
  vec2 t_z = (z - origin.zz) * inverse.zz;
  float enter = max(max(min(t_xy.x, t_xy.y), min(t_xy.z, t_xy.w)), max(min(t_z.x, t_z.y), t_near));
  float leave = min(min(max(t_xy.x, t_xy.y), max(t_xy.z, t_xy.w)), max(t_z.x, t_z.y));
  return vec2(enter, min(leave * widen, t_far));
}

/// The ray as one space sees it. Directions keep their length, so that t means the same in every space.
struct BvhView {
  vec3 origin, direction, inverse;
};

BvhView bvh_view(vec3 origin, vec3 direction) { return BvhView(origin, direction, bvh_inverse(direction)); }

/// The ray as it runs past an instance that stands where it is at t = 0.
BvhRay bvh_unmoved(MotionRecord m, BvhRay ray) {
  if (m.moves == 0u) return ray;
  ray.origin = unmoved_point(m, ray.time_s, ray.origin);
  ray.direction = unmoved_direction(m, ray.time_s, ray.direction);
  return ray;
}

BvhView bvh_local_view(BvhInstance placed, BvhRay ray) {
  vec4 point = vec4(ray.origin, 1.0);
  vec3 origin = vec3(dot(placed.world_to_local0, point), dot(placed.world_to_local1, point), dot(placed.world_to_local2, point));
  vec3 direction = vec3(dot(placed.world_to_local0.xyz, ray.direction), dot(placed.world_to_local1.xyz, ray.direction),
                        dot(placed.world_to_local2.xyz, ray.direction));
  return bvh_view(origin, direction);
}

uint bvh_leaf_count(uint leaf) { return leaf >> bvh_count_shift & 7u; }

bool bvh_hit_leaf(BvhTriangles triangles, uint leaf, BvhView view, inout BvhRay ray, inout BvhHit hit) {
  bool found = false;
  uint first = leaf & bvh_first_mask, end = first + bvh_leaf_count(leaf);
  for (uint i = first; i < end; ++i) {
    if (!hit_triangle(triangles.triangle[i], view.origin, view.direction, ray.t_near, ray.t_far, hit.uv)) continue;
    found = true;
    hit.primitive = triangles.triangle[i].primitive;
  }
  return found;
}

/// any: stops at the first hit found. Returns whether there is one in [t_near, t_far].
bool bvh_trace(BvhNodes top_nodes, BvhInstances instances, MotionArray motions, uint root, const bool any, inout BvhRay ray, out BvhHit hit) {
  uint stack[bvh_stack_size];
  uint height = 0u;
  stack[height++] = bvh_done;
  BvhNodes nodes = top_nodes;
  BvhTriangles triangles;
  uint instance = bvh_world;
  BvhView view = bvh_view(ray.origin, ray.direction);
  bool found = false;
  uint current = root;
  while (current != bvh_done) {
    while ((current & bvh_leaf) == 0u) {
      BvhNode node = nodes.node[current];
      vec2 span0 = bvh_span(node.xy0, node.z.xy, view.origin, view.inverse, ray.t_near, ray.t_far);
      vec2 span1 = bvh_span(node.xy1, node.z.zw, view.origin, view.inverse, ray.t_near, ray.t_far);
      bool hit0 = span0.x <= span0.y, hit1 = span1.x <= span1.y;
      bool second_first = hit1 && (!hit0 || span1.x < span0.x);
      if (hit0 && hit1) stack[height++] = second_first ? node.child0 : node.child1;
      if (hit0 || hit1) current = second_first ? node.child1 : node.child0;
      else current = stack[--height];
    }
    if (current == bvh_done) break;
    if (current == bvh_leave) {
      nodes = top_nodes;
      instance = bvh_world;
      view = bvh_view(ray.origin, ray.direction);
    } else if (instance != bvh_world) {
      if (bvh_hit_leaf(triangles, current, view, ray, hit)) {
        found = true;
        hit.instance = instance;
        if (any) break;
      }
    } else if (bvh_leaf_count(current) != 0u) {
      instance = current & bvh_first_mask;
      BvhRay seen = ray;
      if (rays_have_time) seen = bvh_unmoved(motions.at[instance], ray);
      view = bvh_local_view(instances.instance[instance], seen);
      nodes = BvhNodes(instances.instance[instance].nodes);
      triangles = BvhTriangles(instances.instance[instance].triangles);
      stack[height++] = bvh_leave;
      current = 0u;
      continue;
    }
    current = stack[--height];
  }
  return found;
}

#endif
