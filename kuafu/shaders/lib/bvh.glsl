// SPDX-License-Identifier: Apache-2.0
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
layout(constant_id = 6) const uint nodes_per_step = 1u;      // at most; the tracer's

const uint bvh_top = 0xffffffffu;  // "instance" while the ray is in the top level

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

/// The ray as one space sees it: triangles by origin and direction; boxes by where it meets their planes, p * inverse + lower (or upper, of the plane with the
/// greater coordinate). Directions keep their length, so that t means the same in every space.
struct BvhView {
  vec3 origin, direction, inverse, lower, upper;
};

BvhView bvh_view(vec3 origin, vec3 direction) {
  vec3 inverse = bvh_inverse(direction), offset = -origin * inverse;
  // What the offset's rounding may be, and that of a product that is not fused, moves both planes outwards.
  vec3 rounding = sign(inverse) * abs(offset) * 2.4e-7;
  return BvhView(origin, direction, inverse, offset - rounding, offset + rounding);
}

// As integers, of which a GPU compares three at once. Numbers below 0 are the other way round among themselves: behind the ray a box may seem
// larger than it is, never smaller.
float bvh_greatest(vec3 a, float b) {
  ivec3 bits = floatBitsToInt(a);
  return intBitsToFloat(max(max(max(bits.x, bits.y), bits.z), floatBitsToInt(b)));
}
float bvh_least(vec3 a) {
  ivec3 bits = floatBitsToInt(a);
  return intBitsToFloat(min(min(bits.x, bits.y), bits.z));
}

/// Where the ray is inside a box: (enter, leave), empty when enter > leave.
/// The far side is widened by the rounding of three operations (Ize, "Robust BVH Ray Traversal", 2013), so that flat boxes are not missed.
vec2 bvh_span(vec4 xy, vec2 z, BvhView view, float t_near, float t_far) {
  const float widen = 1.00000036;
  vec4 t_xy = fma(xy, view.inverse.xxyy, vec4(view.lower.x, view.upper.x, view.lower.y, view.upper.y));
  vec2 t_z = fma(z, view.inverse.zz, vec2(view.lower.z, view.upper.z));
  vec3 near = vec3(min(t_xy.x, t_xy.y), min(t_xy.z, t_xy.w), min(t_z.x, t_z.y));
  vec3 far = vec3(max(t_xy.x, t_xy.y), max(t_xy.z, t_xy.w), max(t_z.x, t_z.y));
  return vec2(bvh_greatest(near, t_near), min(bvh_least(far) * widen, t_far));
}

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

/// What is traced: nodes of all top levels, instances, and what moves.
struct BvhWorld {
  BvhNodes nodes;
  BvhInstances instances;
  MotionArray motions;
};

// The walk of this invocation's ray, step by step.
BvhRay bvh_ray;
BvhHit bvh_hit;
bool bvh_found;
uint bvh_current;  // bvh_done at the end
BvhView bvh_here;
BvhNodes bvh_nodes;
BvhTriangles bvh_triangles;
uint bvh_instance;
uint bvh_stack[bvh_stack_size];
uint bvh_height;

void bvh_push(uint code) { bvh_stack[bvh_height++] = code; }
uint bvh_pop() { return bvh_stack[--bvh_height]; }

void bvh_begin(BvhWorld world, uint root, BvhRay ray) {
  bvh_ray = ray;
  bvh_found = false;
  bvh_current = root;
  bvh_here = bvh_view(ray.origin, ray.direction);
  bvh_nodes = world.nodes;
  bvh_instance = bvh_top;
  bvh_height = 0u;
  bvh_push(bvh_done);
}

void bvh_descend() {
  BvhNode node = bvh_nodes.node[bvh_current];
  vec2 span0 = bvh_span(node.xy0, node.z.xy, bvh_here, bvh_ray.t_near, bvh_ray.t_far);
  vec2 span1 = bvh_span(node.xy1, node.z.zw, bvh_here, bvh_ray.t_near, bvh_ray.t_far);
  bool hit0 = span0.x <= span0.y, hit1 = span1.x <= span1.y;
  bool second_first = hit1 && (!hit0 || span1.x < span0.x);
  if (hit0 && hit1) bvh_push(second_first ? node.child0 : node.child1);
  if (hit0 || hit1) bvh_current = second_first ? node.child1 : node.child0;
  else bvh_current = bvh_pop();
}

void bvh_enter(BvhWorld world) {
  bvh_instance = bvh_current & bvh_first_mask;
  BvhRay seen = bvh_ray;
  if (rays_have_time) seen = bvh_unmoved(world.motions.at[bvh_instance], bvh_ray);
  BvhInstance placed = world.instances.instance[bvh_instance];
  bvh_here = bvh_local_view(placed, seen);
  bvh_nodes = BvhNodes(placed.nodes);
  bvh_triangles = BvhTriangles(placed.triangles);
  bvh_push(bvh_leave);
  bvh_current = 0u;
}

void bvh_return(BvhWorld world) {
  bvh_nodes = world.nodes;
  bvh_instance = bvh_top;
  bvh_here = bvh_view(bvh_ray.origin, bvh_ray.direction);
  bvh_current = bvh_pop();
}

/// Whether there is something at a point of a triangle; the includer's.
bool bvh_stands_at(uint instance, uint primitive, vec2 uv);

void bvh_test_leaf(const bool any) {
  uint first = bvh_current & bvh_first_mask, end = first + bvh_leaf_count(bvh_current);
  for (uint i = first; i < end; ++i) {
    if ((features & feature_cutouts) != 0u) {
      float t_far = bvh_ray.t_far;
      vec2 uv;
      if (!hit_triangle(bvh_triangles.triangle[i], bvh_here.origin, bvh_here.direction, bvh_ray.t_near, t_far, uv)) continue;
      if (!bvh_stands_at(bvh_instance, bvh_triangles.triangle[i].primitive, uv)) continue;
      bvh_ray.t_far = t_far;
      bvh_hit.uv = uv;
    } else if (!hit_triangle(bvh_triangles.triangle[i], bvh_here.origin, bvh_here.direction, bvh_ray.t_near, bvh_ray.t_far, bvh_hit.uv)) {
      continue;
    }
    bvh_found = true;
    bvh_hit.primitive = bvh_triangles.triangle[i].primitive;
    bvh_hit.instance = bvh_instance;
  }
  bvh_current = any && bvh_found ? bvh_done : bvh_pop();
}

/// Down to the next leaf and through it, or down by nodes_per_step: the rays of a subgroup that have reached their leaves wait no longer for those that have not.
/// any: stops at the first hit found.
void bvh_step(BvhWorld world, const bool any) {
  for (uint n = 0u; n < nodes_per_step && (bvh_current & bvh_leaf) == 0u; ++n) bvh_descend();
  if ((bvh_current & bvh_leaf) == 0u || bvh_current == bvh_done) return;
  if (bvh_current == bvh_leave) bvh_return(world);
  else if (bvh_instance != bvh_top) bvh_test_leaf(any);
  else if (bvh_leaf_count(bvh_current) != 0u) bvh_enter(world);
  else bvh_current = bvh_pop();
}

#endif
