// SPDX-License-Identifier: Apache-2.0
// Layout of our two-level BVH2, read by GLSL (scalar block layout) and C++.
// A child code names what is below a node: an inner node by its index, or a leaf = bvh_leaf | count << bvh_count_shift | first.
// Leaves of the bottom level hold `count` triangles (0..4); leaves of the top level hold one instance.
#ifndef KUAFU_BVH_NODE_H
#define KUAFU_BVH_NODE_H

#ifdef __cplusplus
#include <cstdint>
#include <glm/glm.hpp>
namespace kuafu {
using uint = uint32_t;
using vec3 = glm::vec3;
using vec4 = glm::vec4;
using bvh_address = uint64_t;
#define KUAFU_BVH_CONST inline constexpr uint
#else
#define KUAFU_BVH_CONST const uint
#define bvh_address uvec2
#endif

KUAFU_BVH_CONST bvh_leaf = 0x80000000u;
KUAFU_BVH_CONST bvh_count_shift = 28u;
KUAFU_BVH_CONST bvh_first_mask = 0x0fffffffu;
KUAFU_BVH_CONST bvh_max_leaf = 4u;
KUAFU_BVH_CONST bvh_done = 0xffffffffu;   // below the last entry of the traversal stack; also the root of an empty top level
KUAFU_BVH_CONST bvh_leave = 0xfffffffeu;  // stands on the stack below an instance's nodes: back to world space
KUAFU_BVH_CONST bvh_top_depth = 24u;      // inner nodes on the longest way down; the builder keeps to it
KUAFU_BVH_CONST bvh_bottom_depth = 36u;
KUAFU_BVH_CONST bvh_stack_size = 62u;     // one entry per inner node on the way, bvh_done and bvh_leave

struct BvhNode {  // 64 bytes
  vec4 xy0;       // child 0: x min, x max, y min, y max
  vec4 xy1;       // child 1
  vec4 z;         // child 0: z min, z max; child 1: z min, z max
  uint child0, child1;
  uint unused0, unused1;
};

struct BvhTriangle {  // 48 bytes
  vec3 v0;
  uint primitive;     // triangle index in its mesh
  vec3 v1;
  uint unused0;
  vec3 v2;
  uint unused1;
};

struct BvhInstance {  // 64 bytes
  vec4 world_to_local0, world_to_local1, world_to_local2;  // rows
  bvh_address nodes;      // of its mesh; node 0 is the root
  bvh_address triangles;
};

#ifdef __cplusplus
static_assert(sizeof(BvhNode) == 64 && sizeof(BvhTriangle) == 48 && sizeof(BvhInstance) == 64);
static_assert(bvh_stack_size == bvh_top_depth + bvh_bottom_depth + 2);
}  // namespace kuafu
#endif
#endif
