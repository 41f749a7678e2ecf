// SPDX-License-Identifier: Apache-2.0
// Aggregation along paths in the scalar reference, by hand and by its laws.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "simsense/match/volumes.h"
#include "simsense/reference/sgm.h"

namespace {

using namespace simsense;
using namespace simsense::reference;

TEST(aggregate, two_pixels_by_hand) {
  // pixel 0: costs 0 9, pixel 1: costs 8 1; p1 = 2, p2 = 5
  const auto mean = aggregate(volume(2, 1, 2, {0, 9, 8, 1}), 2, 5);
  // rightwards at pixel 1: m = min(0, 9+2, 0+5) = 0 and min(9, 0+2, 0+5) = 2. Leftwards at pixel 0: lowest 1,
  // m = min(8, 1+2, 1+5) - 1 = 2 and min(1, 8+2, 1+5) - 1 = 0. The vertical paths have one pixel: m = 0.
  EXPECT_EQ(mean.data, (std::vector<uint16_t>{0 + 2 / 4, 9, 8, 1 + 2 / 4}));
  const auto tall = aggregate(volume(1, 3, 2, {0, 9, 8, 1, 8, 1}), 2, 50);
  // downwards at row 1: m = 0, 2: L = 8, 3; row 2: lowest 3, m = min(8, 3+2, 53) - 3 = 2, min(3, 8+2, 53) - 3 = 0
  // upwards at row 1 (from 8 1): m = min(8, 1+2, 51) - 1 = 2, 0: L = 10, 1; row 0: lowest 1, m = min(10, 1+2) - 1 = 2, 0
  EXPECT_EQ(tall.data, (std::vector<uint16_t>{0 + 2 / 4, 9, 8 + 2 / 4, 1 + 2 / 4, 8 + 2 / 4, 1}));
}

TEST(aggregate, adds_between_nothing_and_p2) {
  const auto cost = random_volume(20, 17, 16, 2, 24);
  const auto mean = aggregate(cost, 7, 86);
  bool some_added = false;
  for (size_t i = 0; i < mean.data.size(); ++i) {
    ASSERT_GE(mean.data[i], cost.data[i]);
    ASSERT_LE(mean.data[i], cost.data[i] + 86);
    some_added |= mean.data[i] > cost.data[i];
  }
  EXPECT_TRUE(some_added);
  EXPECT_EQ(aggregate(cost, 0, 0).data, cost.data) << "without penalties the paths carry nothing";
}

TEST(aggregate, mirrored_image_gives_the_mirrored_result) {
  const auto cost = random_volume(13, 11, 16, 3, 24);
  Volume<uint16_t> mirrored(13, 11, 16);
  for (size_t y = 0; y < 11; ++y) {
    for (size_t x = 0; x < 13; ++x) std::copy_n(cost.at(12 - x, 10 - y), 16, mirrored.at(x, y));
  }
  const auto expected = aggregate(cost, 7, 86), actual = aggregate(mirrored, 7, 86);
  for (size_t y = 0; y < 11; ++y) {
    for (size_t x = 0; x < 13; ++x) ASSERT_TRUE(std::equal(expected.at(x, y), expected.at(x, y) + 16, actual.at(12 - x, 10 - y)));
  }
}

TEST(jump_penalty, falls_with_the_gradient_but_not_below_p1) {
  const std::vector<uint8_t> image = {0, 10, 30, 255};
  const JumpPenalty penalty{7, 86, 10, {image.data(), 4}};
  EXPECT_EQ(penalty.between(1, 0, 0, 0), 86u);
  EXPECT_EQ(penalty.between(2, 0, 1, 0), 43u);
  EXPECT_EQ(penalty.between(1, 0, 2, 0), 43u);
  EXPECT_EQ(penalty.between(3, 0, 2, 0), 7u);
}

TEST(aggregate, eight_paths_by_hand) {
  // one path per direction through the centre of a 3x3 image; only the top left pixel prefers d = 1
  Volume<uint16_t> cost(3, 3, 2);
  for (size_t i = 0; i < 9; ++i) cost.data[2 * i + 1] = 80;
  std::swap(cost.at(0, 0)[0], cost.at(0, 0)[1]);
  const auto eight = aggregate(cost, {8, 40}, 1, 8), four = aggregate(cost, {8, 40}, 1, 4);
  // into the centre: down-right brings L = {80, 0}, m = {8, 0}; the seven others bring L = {0, 80}, m = {0, 8}
  EXPECT_EQ(eight.at(1, 1)[0], 8 / 8);
  EXPECT_EQ(eight.at(1, 1)[1], 80 + 7 * 8 / 8);
  EXPECT_EQ(four.at(1, 1)[0], 0);
}

}  // namespace
