// SPDX-License-Identifier: Apache-2.0
// Hamming costs and block sums of the scalar reference, by hand and by their laws.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "simsense/match/volumes.h"
#include "simsense/reference/census.h"
#include "simsense/reference/cost.h"

namespace {

using namespace simsense;
using namespace simsense::reference;

TEST(hamming_cost, counts_bits_and_repeats_the_first_right_column) {
  Grid<uint64_t> left(3, 1), right(3, 1);
  left.data = {0b0000, 0b1111, 0xffffffffu};
  right.data = {0b0001, 0b0111, 0};
  const auto cost = hamming_cost(left, right, 3);
  EXPECT_EQ(cost.data, (std::vector<uint16_t>{1, 1, 1, 1, 3, 3, 32, 29, 31}));
}

TEST(block_sum, by_hand_with_repeated_edges) {
  const auto cost = volume(3, 2, 2, {1, 10, 2, 20, 3, 30, 4, 40, 5, 50, 6, 60});
  const auto sum = block_sum(cost, 3, 3);
  // d = 0 at (0, 0): columns 0 0 1 of rows 0 0 1: 2 * (1 + 1 + 2) + (4 + 4 + 5)
  EXPECT_EQ(sum.at(0, 0)[0], 21);
  EXPECT_EQ(sum.at(0, 0)[1], 210);
  // at (1, 1): columns 0 1 2 of rows 0 1 1: 6 + 15 + 15
  EXPECT_EQ(sum.at(1, 1)[0], 36);
  EXPECT_EQ(block_sum(cost, 1, 1).data, cost.data);
}

TEST(block_sum, constant_cost_becomes_cost_times_area) {
  auto cost = random_volume(9, 8, 4, 1, 0);
  std::fill(cost.data.begin(), cost.data.end(), uint16_t{24});
  for (const uint16_t value : block_sum(cost, 15, 17).data) ASSERT_EQ(value, 24 * 15 * 17);
}

TEST(hamming_cost, starts_at_the_first_disparity) {
  Grid<uint64_t> left(4, 1), right(4, 1);
  left.data = {0, 0, 0, 0};
  right.data = {1, 3, 7, 15};
  const auto behind = hamming_cost(left, right, 2, -2), ahead = hamming_cost(left, right, 2, 1);
  EXPECT_EQ(behind.data, (std::vector<uint16_t>{3, 2, 4, 3, 4, 4, 4, 4})) << "columns 2 1, 3 2, 3 3 (4 repeats 3), 3 3";
  EXPECT_EQ(ahead.data, (std::vector<uint16_t>{1, 1, 1, 1, 2, 1, 3, 2}));
}

}  // namespace
