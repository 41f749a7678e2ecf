// SPDX-License-Identifier: Apache-2.0
// One environment's top level: a BVH2 over world boxes of instances that follows single instances: a box that moves costs the way to the
// root. Built by the surface area heuristic; worn out when changes made it half as dear again. Thread rule: externally synchronised.
#pragma once

#include <utility>

#include "accel/bvh_builder.h"

namespace kuafu {

class TopLevel {
 public:
  /// Builds the tree over these slots. boxes: by slot.
  void build(std::span<const uint32_t> slots, std::span<const Box> boxes);
  void move(uint32_t slot, const Box& box);
  void erase(uint32_t slot);
  /// Inserts a slot. Returns false if the tree would become too deep: then rebuild it.
  [[nodiscard]] bool insert(uint32_t slot, const Box& box);

  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] bool worn_out() const;
  /// The tree. An inner node's code is an index into it, a leaf names a slot. Node 0 is the root and always exists.
  [[nodiscard]] const std::vector<BvhNode>& nodes() const { return nodes_; }
  /// Returns the nodes written since the last call, in any order and perhaps twice.
  std::vector<uint32_t> take_changes() { return std::exchange(changes_, {}); }

 private:
  struct Place {  // a child of a node
    uint32_t node = none, child = 0;
  };
  static constexpr uint32_t none = 0xffffffffu;

  void set_child(Place at, uint32_t code, const Box& box);
  void refit_above(uint32_t node);
  [[nodiscard]] uint32_t take_node();
  [[nodiscard]] Place& place_of(uint32_t code);
  [[nodiscard]] double cost() const;

  std::vector<BvhNode> nodes_{BvhNode{}};
  std::vector<Place> parents_{Place{}};  // by node
  std::vector<Place> leaves_;            // by slot
  std::vector<uint32_t> free_, changes_;
  uint32_t count_ = 0;
  double area_ = 0.0, cost_when_built_ = 0.0;  // sum of half areas of all children's boxes
};

/// Returns the world box of a local box, rounded outwards.
Box world_box(const Box& local, const glm::dmat4& local_to_world);

}  // namespace kuafu
