// SPDX-License-Identifier: Apache-2.0
// A top level that follows single boxes stays what one built of the same boxes is: sound, shallow enough, and not much dearer.
#include "accel/top_level.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "kuafu/accel/worlds.h"

namespace kuafu::test {
namespace {

Box box_at(Random& random, double spread) {
  Box box;
  box.add(glm::vec3(random.in_cube(spread)));
  box.add(box.min + glm::vec3(random.in_cube(0.1)));
  return box;
}

struct Walk {
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
  Walk walk{top, {}};
  walk.node(0, 1);
  EXPECT_LE(walk.deepest, bvh_top_depth);
  EXPECT_EQ(top.empty(), boxes.empty());
  ASSERT_EQ(walk.leaves.size(), boxes.size());
  for (const auto& [slot, box] : boxes) {
    ASSERT_TRUE(walk.leaves.contains(slot)) << slot;
    EXPECT_TRUE(walk.leaves[slot].min == box.min && walk.leaves[slot].max == box.max);
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
    Walk walk{top, {}};
    walk.node(0, 1);
    ASSERT_LE(walk.deepest, bvh_top_depth);
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
