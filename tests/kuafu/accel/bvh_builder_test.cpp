// SPDX-License-Identifier: Apache-2.0
#include "accel/bvh_builder.h"
#include "capi/device/expect_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "device/error.h"
#include "kuafu/accel/worlds.h"

namespace kuafu::test {
namespace {

std::vector<Box> random_boxes(uint32_t count) {
  Random random(7);
  std::vector<Box> boxes(count);
  for (Box& box : boxes) {
    box.add(glm::vec3(random.in_cube(1.0)));
    box.add(box.min + glm::vec3(random.in_cube(0.05)));
  }
  return boxes;
}

/// Each twice as far as the one before: the heuristic alone would peel them off one by one.
std::vector<Box> geometric_boxes(uint32_t count) {
  std::vector<Box> boxes(count);
  for (uint32_t i = 0; i < count; ++i) {
    const float x = std::ldexp(1.0f, int(i % 120));
    boxes[i].add({x, 0.0f, 0.0f});
    boxes[i].add({x * 1.001f, 1e-3f, 1e-3f});
  }
  return boxes;
}

struct Walk {
  const Bvh& bvh;
  const std::vector<Box>& boxes;
  std::vector<uint32_t> seen;
  uint32_t deepest = 0, fullest = 0;

  void node(uint32_t index, uint32_t depth) {
    deepest = std::max(deepest, depth);
    const BvhNode& n = bvh.nodes.at(index);
    child(n.child0, {{n.xy0.x, n.xy0.z, n.z.x}, {n.xy0.y, n.xy0.w, n.z.y}}, depth);
    child(n.child1, {{n.xy1.x, n.xy1.z, n.z.z}, {n.xy1.y, n.xy1.w, n.z.w}}, depth);
  }

  void child(uint32_t code, const Box& bounds, uint32_t depth) {
    if (!(code & bvh_leaf)) return node(code, depth + 1);
    const uint32_t count = code >> bvh_count_shift & 7u;
    fullest = std::max(fullest, count);
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t id = bvh.order.at((code & bvh_first_mask) + i);
      seen.push_back(id);
      EXPECT_EQ(glm::min(boxes[id].min, bounds.min), bounds.min);
      EXPECT_EQ(glm::max(boxes[id].max, bounds.max), bounds.max);
    }
  }
};

void expect_sound(const std::vector<Box>& boxes, uint32_t max_leaf, uint32_t max_depth) {
  const Bvh bvh = build_bvh(boxes, max_leaf, max_depth);
  Walk walk{bvh, boxes, {}};
  walk.node(0, 1);
  EXPECT_LE(walk.deepest, max_depth);
  EXPECT_LE(walk.fullest, max_leaf);
  std::sort(walk.seen.begin(), walk.seen.end());
  std::vector<uint32_t> all(boxes.size());
  std::iota(all.begin(), all.end(), 0u);
  EXPECT_EQ(walk.seen, all);
}

TEST(BvhBuilder, EveryBoxIsInOneLeafInsideItsBounds) {
  for (const uint32_t count : {0u, 1u, 2u, 4u, 5u, 17u, 3000u}) expect_sound(random_boxes(count), 4, bvh_bottom_depth);
  expect_sound(random_boxes(1000), 1, bvh_top_depth);
}

TEST(BvhBuilder, DepthIsKeptOnScenesThatTemptTheHeuristic) {
  expect_sound(geometric_boxes(120), 4, 7);
  expect_sound(geometric_boxes(120), 1, 7);  // 120 leaves of one need all of the 7 levels
  expect_sound(geometric_boxes(2000), 1, 12);
}

TEST(BvhBuilder, EqualBoxesAreSplitAllTheSame) { expect_sound(std::vector<Box>(1000, Box{glm::vec3(0.0f), glm::vec3(1.0f)}), 4, 10); }

TEST(BvhBuilder, HugeAndTinyExtentsStaySound) {
  std::vector<Box> boxes = random_boxes(100);
  for (size_t i = 0; i < boxes.size(); ++i) {
    const float scale = i % 2 ? 1e30f : 1e-38f;
    boxes[i].min *= scale, boxes[i].max *= scale;
  }
  expect_sound(boxes, 4, bvh_bottom_depth);
}

TEST(BvhBuilder, TooManyBoxesForTheDepthIsAnError) { EXPECT_ERROR(build_bvh(random_boxes(129), 1, 7), KS_ERROR_UNSUPPORTED, ""); }

TEST(BvhBuilder, HeuristicBeatsMedianSplitsOnClusters) {
  // A dense cluster beside a sparse one: splitting between them keeps the dense half small. Expected cost = sum of half areas of inner
  // nodes.
  Random random(3);
  std::vector<Box> boxes(1024);
  for (size_t i = 0; i < boxes.size(); ++i) {
    const bool dense = i % 8 != 0;
    const glm::vec3 at = glm::vec3(random.in_cube(dense ? 0.01 : 1.0)) + (dense ? glm::vec3(4.0f, 0.0f, 0.0f) : glm::vec3(0.0f));
    boxes[i].add(at), boxes[i].add(at + glm::vec3(0.001f));
  }
  const auto cost = [](const Bvh& bvh) {
    double sum = 0.0;
    for (const BvhNode& n : bvh.nodes) {
      sum += Box{{n.xy0.x, n.xy0.z, n.z.x}, {n.xy0.y, n.xy0.w, n.z.y}}.half_area();
      sum += Box{{n.xy1.x, n.xy1.z, n.z.z}, {n.xy1.y, n.xy1.w, n.z.w}}.half_area();
    }
    return sum;
  };
  const Bvh median = build_bvh(boxes, 1, 10);  // 1024 leaves in 10 levels leave no choice but halving
  EXPECT_LT(cost(build_bvh(boxes, 1, bvh_top_depth)), 0.95 * cost(median));
}

}  // namespace
}  // namespace kuafu::test
