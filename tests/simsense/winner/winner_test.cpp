// SPDX-License-Identifier: Apache-2.0
// Winners, uniqueness, subpixel steps and confidence of the scalar reference, by hand and by their laws.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "simsense/match/volumes.h"
#include "simsense/reference/winner.h"

namespace {

using namespace simsense;
using namespace simsense::reference;

TEST(left_winner, smallest_disparity_of_lowest_cost_wins) {
  EXPECT_EQ(left_winner(volume(1, 1, 5, {9, 4, 7, 4, 9}), 0, Subpixel::none, nullptr).data[0], 1.0f);
  EXPECT_EQ(left_winner(volume(1, 1, 5, {9, 8, 7, 6, 5}), 0, Subpixel::parabola, nullptr).data[0], 4.0f)
      << "no parabola at the last disparity";
  EXPECT_EQ(left_winner(volume(1, 1, 5, {1, 8, 7, 6, 5}), 0, Subpixel::parabola, nullptr).data[0], 0.0f)
      << "no parabola at the first disparity";
}

TEST(left_winner, uniqueness_spares_the_neighbours_and_is_strict) {
  // 85 % of 100 is 85: a rival of 99 is too near, one of 100 is not
  EXPECT_EQ(left_winner(volume(1, 1, 5, {85, 86, 999, 999, 99}), 15, Subpixel::none, nullptr).data[0], -1.0f);
  EXPECT_EQ(left_winner(volume(1, 1, 5, {85, 86, 999, 999, 100}), 15, Subpixel::none, nullptr).data[0], 0.0f);
  EXPECT_EQ(left_winner(volume(1, 1, 5, {999, 86, 85, 86, 999}), 15, Subpixel::none, nullptr).data[0], 2.0f);
  EXPECT_EQ(left_winner(volume(1, 1, 5, {0, 9, 0, 9, 0}), 15, Subpixel::none, nullptr).data[0], 0.0f) << "nothing is below 0";
}

TEST(left_winner, parabola_finds_the_vertex) {
  for (int tenths = -4; tenths <= 4; ++tenths) {
    std::vector<uint16_t> costs;
    for (int d = 0; d < 16; ++d) costs.push_back(static_cast<uint16_t>((10 * d - 70 - tenths) * (10 * d - 70 - tenths)));
    EXPECT_NEAR(left_winner(volume(1, 1, 16, costs), 0, Subpixel::parabola, nullptr).data[0], 7.0 + tenths / 10.0, 1e-5);
  }
  EXPECT_EQ(left_winner(volume(1, 1, 5, {5, 5, 5, 5, 5}), 0, Subpixel::parabola, nullptr).data[0], 0.0f);
  EXPECT_EQ(left_winner(volume(1, 1, 5, {9, 5, 5, 5, 9}), 0, Subpixel::parabola, nullptr).data[0], 1.5f);
}

TEST(left_winner, equiangular_finds_the_apex_of_a_v) {
  for (int tenths = -5; tenths <= 4; ++tenths) {
    std::vector<uint16_t> costs;
    for (int d = 0; d < 16; ++d) costs.push_back(static_cast<uint16_t>(std::abs(30 * d - 210 - 3 * tenths)));
    EXPECT_NEAR(left_winner(volume(1, 1, 16, costs), 0, Subpixel::equiangular, nullptr).data[0], 7.0 + tenths / 10.0, 1e-5);
  }
  EXPECT_EQ(left_winner(volume(1, 1, 5, {5, 5, 5, 5, 5}), 0, Subpixel::equiangular, nullptr).data[0], 0.0f);
}

TEST(left_winner, equiangular_prefers_the_costs_of_the_block_where_they_have_a_minimum) {
  const auto summed = volume(1, 1, 5, {90, 60, 10, 60, 90});
  const auto minimum = volume(1, 1, 5, {9, 8, 2, 6, 9}), slope = volume(1, 1, 5, {1, 2, 3, 4, 5});
  EXPECT_NEAR(left_winner(summed, 0, Subpixel::equiangular, &minimum).data[0], 2.0 + (8 - 6) / 12.0, 1e-6);
  EXPECT_EQ(left_winner(summed, 0, Subpixel::equiangular, &slope).data[0], 2.0f);
}

TEST(right_winner, follows_the_diagonal_of_the_volume) {
  const auto cost = random_volume(30, 5, 16, 4, 60);
  Volume<uint16_t> sheared(30, 5, 16);
  for (size_t y = 0; y < 5; ++y) {
    for (size_t x = 0; x < 30; ++x) {
      for (size_t d = 0; d < 16; ++d) sheared.at(x, y)[d] = x + d < 30 ? cost.at(x + d, y)[d] : uint16_t{60000};
    }
  }
  const auto right = right_winner(cost);
  const auto left_of_sheared = left_winner(sheared, 0, Subpixel::none, nullptr);
  for (size_t i = 0; i < right.data.size(); ++i) ASSERT_EQ(static_cast<float>(right.data[i]), left_of_sheared.data[i]);
}

TEST(confidence, is_the_margin_that_the_uniqueness_test_asks_for) {
  Volume<uint16_t> cost(1, 1, 6);
  cost.data = {90, 60, 30, 35, 40, 80};
  EXPECT_FLOAT_EQ(confidence(cost).data[0], 1.0f - 30.0f / 40.0f);
  EXPECT_GE(left_winner(cost, 25, Subpixel::none, nullptr).data[0], 0.0f);
  EXPECT_EQ(left_winner(cost, 26, Subpixel::none, nullptr).data[0], -1.0f);
  cost.data = {0, 0, 0, 0, 0, 0};
  EXPECT_EQ(confidence(cost).data[0], 0.0f);
}

TEST(equiangular_summed, looks_at_the_aggregated_costs_alone) {
  Volume<uint16_t> summed(1, 1, 5), block(1, 1, 5);
  summed.data = {90, 60, 10, 50, 90};
  block.data = {9, 8, 2, 6, 9};
  EXPECT_FLOAT_EQ(left_winner(summed, 0, Subpixel::equiangular_summed, &block).data[0], 2.0f + (60 - 50) / 100.0f);
}

}  // namespace
