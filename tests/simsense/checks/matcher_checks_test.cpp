// SPDX-License-Identifier: Apache-2.0
// Left-right check and median of the scalar reference, by hand and by their laws.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "simsense/match/volumes.h"
#include "simsense/reference/checks.h"

namespace {

using namespace simsense;
using namespace simsense::reference;

TEST(left_right_check, by_hand) {
  Grid<uint32_t> right(5, 1);
  right.data = {1, 2, 0, 0, 0};
  // x 0: 0 against right[0] = 1. x 1: 1.4 rounds to 1, right[0] = 1. x 2: 0.5 rounds up to 1, right[1] = 2. x 3: 2.6 rounds to 3,
  // right[0] = 1. x 4: 5 points outside
  const auto left = grid(5, 1, {0.0f, 1.4f, 0.5f, 2.6f, 5.0f});
  EXPECT_EQ(left_right_check(left, right, 1).data, (std::vector<float>{0.0f, 1.4f, 0.5f, -1.0f, -1.0f}));
  EXPECT_EQ(left_right_check(left, right, 0).data, (std::vector<float>{-1.0f, 1.4f, -1.0f, -1.0f, -1.0f}));
  EXPECT_EQ(left_right_check(left, right, 2).data, (std::vector<float>{0.0f, 1.4f, 0.5f, 2.6f, -1.0f}));
}

TEST(median, by_hand_with_invalid_values_and_copied_border) {
  const auto map = grid(4, 3,
                        {-1, 5, 3, 8,  //
                         7, 90, 2, 9,  //
                         4, -1, 6, 1});
  // centre windows: {-1 5 3 7 90 2 4 -1 6} -> 4 and {5 3 8 90 2 9 -1 6 1} -> 5
  EXPECT_EQ(median(map, 3).data, (std::vector<float>{-1, 5, 3, 8, 7, 4, 5, 9, 4, -1, 6, 1}));
  EXPECT_EQ(median(map, 1).data, map.data);
}

TEST(median, keeps_a_plane_and_removes_a_speck) {
  for (const size_t size : {3u, 5u, 7u}) {
    Grid<float> plane(20, 20);
    for (size_t y = 0; y < 20; ++y) {
      for (size_t x = 0; x < 20; ++x) plane.at(x, y) = static_cast<float>(3 * x + 2 * y);
    }
    EXPECT_EQ(median(plane, size).data, plane.data);
    Grid<float> flat(20, 20, 8.0f);
    const auto expected = flat.data;
    flat.at(10, 10) = 77.0f;
    EXPECT_EQ(median(flat, size).data, expected);
  }
}

}  // namespace
