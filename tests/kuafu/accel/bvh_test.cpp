// SPDX-License-Identifier: Apache-2.0
// The trees over triangles and over instances: sound, bounded, refitted.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>

#include "accel/bvh_builder.h"
#include "accel/mesh_bvh.h"
#include "accel/top_level.h"
#include "capi/device/expect_error.h"
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
  // A dense cluster beside a sparse one: a split between them keeps the dense half small. Cost: the sum of inner nodes' half areas.
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

Mesh shaken(Mesh mesh, double reach) {
  Random random(5);
  for (glm::vec3& position : mesh.positions) position += glm::vec3(random.in_cube(reach));
  return mesh;
}

bool same(const Box& a, const Box& b) { return a.min == b.min && a.max == b.max; }

/// Box of what is below a child; every box on the way must be exactly that of what it holds.
Box walk(const MeshBvh& bvh, const Mesh& mesh, uint32_t code) {
  Box box;
  if (code & bvh_leaf) {
    for (uint32_t i = 0; i < (code >> bvh_count_shift & 7u); ++i) {
      const BvhTriangle& triangle = bvh.triangles.at((code & bvh_first_mask) + i);
      const glm::uvec3 corners = mesh.indices.at(triangle.primitive);
      EXPECT_EQ(triangle.v0, mesh.positions[corners.x]);
      EXPECT_EQ(triangle.v1, mesh.positions[corners.y]);
      EXPECT_EQ(triangle.v2, mesh.positions[corners.z]);
      box.add(triangle.v0), box.add(triangle.v1), box.add(triangle.v2);
    }
    return box;
  }
  const BvhNode& node = bvh.nodes.at(code);
  for (int child = 0; child < 2; ++child) {
    const Box below = walk(bvh, mesh, child == 0 ? node.child0 : node.child1);
    EXPECT_TRUE(same(child_box(node, child), below));
    box.add(below);
  }
  return box;
}

TEST(MeshBvh, RefittedBoxesAreExactlyThoseOfTheirTriangles) {
  Random random(1);
  for (const Mesh& mesh : {soup(random, 1, 0.3), soup(random, 5, 0.3), soup(random, 700, 0.3), sphere(12)}) {
    MeshBvh bvh = build_mesh_bvh(mesh);
    const Mesh moved = shaken(mesh, 0.5);
    refit_mesh_bvh(bvh, moved);
    EXPECT_TRUE(same(bvh.bounds, walk(bvh, moved, 0)));
  }
}

TEST(MeshBvh, RefitWithoutMotionChangesNoBit) {
  const Mesh mesh = sphere(20);
  const MeshBvh built = build_mesh_bvh(mesh);
  MeshBvh refitted = built;
  refit_mesh_bvh(refitted, mesh);
  EXPECT_EQ(std::memcmp(refitted.nodes.data(), built.nodes.data(), built.nodes.size() * sizeof(BvhNode)), 0);
}

TEST(MeshBvh, CostGrowsWhenNeighboursPartAndNotWhenTheyStayTogether) {
  const Mesh mesh = sphere(20);
  MeshBvh bvh = build_mesh_bvh(mesh);
  const double built = expected_cost(bvh.nodes);
  Mesh scaled = mesh;
  for (glm::vec3& position : scaled.positions) position = 2.0f * position + 1.0f;
  refit_mesh_bvh(bvh, scaled);
  EXPECT_NEAR(expected_cost(bvh.nodes), built, 1e-4 * built);
  refit_mesh_bvh(bvh, shaken(mesh, 0.02));
  EXPECT_LT(expected_cost(bvh.nodes), 1.5 * built);
  refit_mesh_bvh(bvh, shaken(mesh, 1.0));
  EXPECT_GT(expected_cost(bvh.nodes), 1.5 * built);
}

Box box_at(Random& random, double spread) {
  Box box;
  box.add(glm::vec3(random.in_cube(spread)));
  box.add(box.min + glm::vec3(random.in_cube(0.1)));
  return box;
}

struct TopWalk {
  const TopLevel& top;
  std::map<uint32_t, Box> leaves;  // slot -> box that the tree has
  uint32_t deepest = 0;

  Box node(uint32_t index, uint32_t depth) {
    deepest = std::max(deepest, depth);
    const BvhNode& n = top.nodes().at(index);
    Box all;
    for (int child = 0; child < 2; ++child) {
      const uint32_t code = child == 0 ? n.child0 : n.child1;
      const Box box = child_box(n, child);
      all.add(box);
      if (code == bvh_leaf) continue;
      if (code & bvh_leaf) {
        EXPECT_TRUE(leaves.emplace(code & bvh_first_mask, box).second) << "slot " << (code & bvh_first_mask) << " stands there twice";
      } else {
        const Box below = node(code, depth + 1);
        EXPECT_TRUE(below.min == box.min && below.max == box.max) << "a box is not that of what is below it";
      }
    }
    return all;
  }
};

void expect_holds(const TopLevel& top, const std::map<uint32_t, Box>& boxes) {
  TopWalk walk_top{top, {}};
  walk_top.node(0, 1);
  EXPECT_LE(walk_top.deepest, bvh_top_depth);
  EXPECT_EQ(top.empty(), boxes.empty());
  ASSERT_EQ(walk_top.leaves.size(), boxes.size());
  for (const auto& [slot, box] : boxes) {
    ASSERT_TRUE(walk_top.leaves.contains(slot)) << slot;
    EXPECT_TRUE(walk_top.leaves[slot].min == box.min && walk_top.leaves[slot].max == box.max);
  }
}

TopLevel built(const std::map<uint32_t, Box>& boxes) {
  std::vector<uint32_t> slots;
  std::vector<Box> by_slot(boxes.empty() ? 0 : boxes.rbegin()->first + 1);
  for (const auto& [slot, box] : boxes) slots.push_back(slot), by_slot[slot] = box;
  TopLevel top;
  top.build(slots, by_slot);
  return top;
}

TEST(TopLevel, IsSoundAfterAnyMixOfMovesRemovalsAndInsertions) {
  Random random(1);
  for (const uint32_t count : {0u, 1u, 2u, 3u, 40u}) {
    std::map<uint32_t, Box> boxes;
    for (uint32_t i = 0; i < count; ++i) boxes[3 * i] = box_at(random, 2.0);
    TopLevel top = built(boxes);
    expect_holds(top, boxes);
    for (int step = 0; step < 400; ++step) {
      const uint32_t slot = random.below(60);
      const Box box = box_at(random, 3.0);
      if (!boxes.contains(slot)) {
        ASSERT_TRUE(top.insert(slot, box));
        boxes[slot] = box;
      } else if (random.uniform() < 0.5) {
        top.erase(slot);
        boxes.erase(slot);
      } else {
        top.move(slot, box);
        boxes[slot] = box;
      }
      if (step % 20 == 0) expect_holds(top, boxes);
    }
    expect_holds(top, boxes);
    while (!boxes.empty()) {
      top.erase(boxes.begin()->first);
      boxes.erase(boxes.begin());
    }
    expect_holds(top, boxes);
  }
}

TEST(TopLevel, TellsWhichNodesItWrote) {
  Random random(2);
  std::map<uint32_t, Box> boxes;
  for (uint32_t i = 0; i < 1000; ++i) boxes[i] = box_at(random, 10.0);
  TopLevel top = built(boxes);
  std::vector<BvhNode> copy(top.nodes().size());
  for (int step = 0; step < 50; ++step) {
    const auto changes = top.take_changes();
    EXPECT_LT(changes.size(), step == 0 ? 2000 : 3 * bvh_top_depth) << "one move costs the way to the root";
    copy.resize(top.nodes().size());
    for (const uint32_t n : changes) copy[n] = top.nodes()[n];
    for (size_t n = 0; n < copy.size(); ++n)
      ASSERT_EQ(std::memcmp(&copy[n], &top.nodes()[n], sizeof(BvhNode)), 0) << "node " << n << " changed unsaid";
    const uint32_t slot = random.below(1000);
    top.move(slot, box_at(random, 10.0));
  }
}

TEST(TopLevel, KeepsToTheDepthOrSaysThatItCannot) {
  TopLevel top = built({});
  bool refused = false;
  for (uint32_t i = 0; i < 120 && !refused; ++i) {  // each twice as far as the one before, which makes one long way
    Box box;
    box.add(glm::vec3(std::ldexp(1.0f, int(i)), 0.0f, 0.0f));
    box.add(box.min * 1.001f + 1e-3f);
    refused = !top.insert(i, box);
    TopWalk walk_top{top, {}};
    walk_top.node(0, 1);
    ASSERT_LE(walk_top.deepest, bvh_top_depth);
  }
  EXPECT_TRUE(refused);
}

TEST(TopLevel, WearsOutWhereChangesSpoiltIt) {
  Random random(3);
  std::map<uint32_t, Box> boxes;
  for (uint32_t i = 0; i < 500; ++i) boxes[i] = box_at(random, 10.0);
  TopLevel top = built(boxes);
  EXPECT_FALSE(top.worn_out());
  top.move(7, box_at(random, 10.0));
  EXPECT_FALSE(top.worn_out()) << "by one of 500";
  for (uint32_t i = 0; i < 500; ++i) top.move(i, box_at(random, 10.0));
  EXPECT_TRUE(top.worn_out()) << "by a wholly new order";
}

}  // namespace
}  // namespace kuafu::test
