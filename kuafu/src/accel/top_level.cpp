// SPDX-License-Identifier: Apache-2.0
#include "accel/top_level.h"

#include <cmath>
#include <numeric>

#include "scene/box_corners.h"

namespace kuafu {
namespace {

constexpr uint32_t empty_leaf = bvh_leaf;
constexpr double worn = 1.5;

uint32_t leaf_of(uint32_t slot) { return bvh_leaf | 1u << bvh_count_shift | slot; }
bool is_leaf(uint32_t code) { return (code & bvh_leaf) != 0; }
uint32_t code_of(const BvhNode& node, uint32_t child) { return child == 0 ? node.child0 : node.child1; }

bool same(const Box& a, const Box& b) { return a.min == b.min && a.max == b.max; }

}  // namespace

void TopLevel::build(std::span<const uint32_t> slots, std::span<const Box> boxes) {
  std::vector<Box> own;
  uint32_t slot_count = 0;
  for (const uint32_t slot : slots) {
    own.push_back(boxes[slot]);
    slot_count = std::max(slot_count, slot + 1);
  }
  const Bvh bvh = build_bvh(own, 1, bvh_top_depth);
  nodes_ = bvh.nodes;
  parents_.assign(nodes_.size(), {});
  leaves_.assign(slot_count, {});
  free_.clear();
  changes_.resize(nodes_.size());
  std::iota(changes_.begin(), changes_.end(), 0u);
  count_ = uint32_t(slots.size());
  area_ = 0.0;
  for (uint32_t n = 0; n < nodes_.size(); ++n)
    for (uint32_t child = 0; child < 2; ++child) {
      uint32_t& code = child == 0 ? nodes_[n].child0 : nodes_[n].child1;
      if (code == empty_leaf) continue;
      if (is_leaf(code)) code = leaf_of(slots[bvh.order[code & bvh_first_mask]]);
      place_of(code) = {n, child};
      area_ += child_box(nodes_[n], int(child)).half_area();
    }
  cost_when_built_ = cost();
}

TopLevel::Place& TopLevel::place_of(uint32_t code) { return is_leaf(code) ? leaves_[code & bvh_first_mask] : parents_[code]; }

double TopLevel::cost() const {
  const double root = node_box(nodes_[0]).half_area();
  return root > 0.0 ? area_ / root : 0.0;
}

bool TopLevel::worn_out() const { return !(cost() <= worn * cost_when_built_ + 2.0); }

void TopLevel::set_child(Place at, uint32_t code, const Box& box) {
  BvhNode& node = nodes_[at.node];
  area_ += double(box.half_area()) - double(child_box(node, int(at.child)).half_area());
  (at.child == 0 ? node.child0 : node.child1) = code;
  set_child_box(node, int(at.child), box);
  if (code != empty_leaf) place_of(code) = at;
  changes_.push_back(at.node);
}

void TopLevel::refit_above(uint32_t node) {
  for (Place up = parents_[node]; up.node != none; node = up.node, up = parents_[node]) {
    const Box box = node_box(nodes_[node]);
    if (same(box, child_box(nodes_[up.node], int(up.child)))) return;
    set_child(up, node, box);
  }
}

void TopLevel::move(uint32_t slot, const Box& box) {
  const Place at = leaves_[slot];
  set_child(at, leaf_of(slot), box);
  refit_above(at.node);
}

void TopLevel::erase(uint32_t slot) {
  const Place at = std::exchange(leaves_[slot], {});
  --count_;
  set_child(at, empty_leaf, {});
  if (at.node == 0) return;
  // Its sibling takes the node's place.
  const uint32_t sibling = code_of(nodes_[at.node], 1 - at.child);
  const Box box = child_box(nodes_[at.node], int(1 - at.child));
  const Place up = parents_[at.node];
  set_child({at.node, 1 - at.child}, empty_leaf, {});
  free_.push_back(at.node);
  set_child(up, sibling, box);
  refit_above(up.node);
}

uint32_t TopLevel::take_node() {
  if (free_.empty()) {
    free_.push_back(uint32_t(nodes_.size()));
    nodes_.emplace_back();
    parents_.emplace_back();
  }
  const uint32_t node = free_.back();
  free_.pop_back();
  nodes_[node] = {};
  for (int child = 0; child < 2; ++child) set_child_box(nodes_[node], child, {});
  nodes_[node].child0 = nodes_[node].child1 = empty_leaf;
  return node;
}

bool TopLevel::insert(uint32_t slot, const Box& box) {
  if (slot >= leaves_.size()) leaves_.resize(slot + 1);
  Place at{0, 0};
  for (uint32_t depth = 1;; ++depth) {
    const BvhNode& node = nodes_[at.node];
    double growth[2];
    for (int child = 0; child < 2; ++child) {
      Box grown = child_box(node, child);
      const double before = grown.half_area();
      grown.add(box);
      growth[child] = double(grown.half_area()) - before;
    }
    at.child = growth[1] < growth[0] ? 1 : 0;
    for (uint32_t child = 0; child < 2; ++child)
      if (code_of(node, child) == empty_leaf) at.child = child;
    const uint32_t code = code_of(node, at.child);
    if (is_leaf(code)) {
      if (code != empty_leaf && depth >= bvh_top_depth) return false;
      break;
    }
    at.node = code;
  }
  ++count_;
  const uint32_t neighbour = code_of(nodes_[at.node], at.child);
  if (neighbour == empty_leaf) {
    set_child(at, leaf_of(slot), box);
    refit_above(at.node);
    return true;
  }
  const uint32_t node = take_node();
  const Box neighbour_box = child_box(nodes_[at.node], int(at.child));
  set_child({node, 0}, neighbour, neighbour_box);
  set_child({node, 1}, leaf_of(slot), box);
  set_child(at, node, node_box(nodes_[node]));
  refit_above(at.node);
  return true;
}

Box world_box(const Box& local, const glm::dmat4& local_to_world) {
  glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
  for (const glm::dvec3& corner : box_corners(local)) {
    const glm::dvec3 q(local_to_world * glm::dvec4(corner, 1.0));
    low = glm::min(low, q), high = glm::max(high, q);
  }
  Box box;
  const float infinity = std::numeric_limits<float>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    box.min[axis] = std::nextafter(float(low[axis]), -infinity);
    box.max[axis] = std::nextafter(float(high[axis]), infinity);
  }
  return box;
}

}  // namespace kuafu
