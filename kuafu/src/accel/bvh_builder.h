// SPDX-License-Identifier: Apache-2.0
// Builds a BVH2 over boxes by the binned surface area heuristic (Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies",
// 2007). Thread rule: pure function.
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "shared/bvh_node.h"

namespace kuafu {

struct Box {
  glm::vec3 min{std::numeric_limits<float>::infinity()}, max{-std::numeric_limits<float>::infinity()};

  void add(const glm::vec3& point) { min = glm::min(min, point), max = glm::max(max, point); }
  void add(const Box& box) { min = glm::min(min, box.min), max = glm::max(max, box.max); }
  [[nodiscard]] bool empty() const { return !(min.x <= max.x); }
  [[nodiscard]] glm::vec3 centroid() const { return 0.5f * min + 0.5f * max; }
  [[nodiscard]] float half_area() const {
    if (empty()) return 0.0f;
    const glm::vec3 size = max - min;
    return size.x * size.y + size.y * size.z + size.z * size.x;
  }
};

/// Box of child 0 or 1; empty if the child is a leaf without primitives.
Box child_box(const BvhNode& node, int child);
void set_child_box(BvhNode& node, int child, const Box& box);
/// Box around both children.
Box node_box(const BvhNode& node);

/// Expected cost of a ray that hits the root's box, in triangle tests (surface area heuristic); 0 for a tree without extent.
double expected_cost(std::span<const BvhNode> nodes);

struct Bvh {
  std::vector<BvhNode> nodes;   // node 0 is the root and always there; parents before children
  std::vector<uint32_t> order;  // leaf entry -> index of the box given
  Box bounds;
};

/// Builds a BVH. max_leaf: most boxes in a leaf, <= bvh_max_leaf. max_depth: most inner nodes from root to leaf, for any input; at least
/// log2(boxes / max_leaf). Where the heuristic would go deeper, splits are at the median.
Bvh build_bvh(std::span<const Box> boxes, uint32_t max_leaf, uint32_t max_depth);

}  // namespace kuafu
