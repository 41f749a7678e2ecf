// SPDX-License-Identifier: Apache-2.0
// The steps of the scalar reference by hand and by their laws: census words, costs, paths, winners.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "simsense/match/volumes.h"
#include "simsense/reference/match.h"

namespace {

using namespace simsense;
using namespace simsense::reference;

MatchParameters window(size_t width, size_t height, CensusKind kind = CensusKind::center_symmetric, uint32_t contrast = 0) {
  MatchParameters p;
  p.census_width = static_cast<uint32_t>(width);
  p.census_height = static_cast<uint32_t>(height);
  p.census_kind = kind;
  p.census_contrast_256ths = contrast;
  return p;
}

TEST(census, each_mirrored_pair_is_one_bit_and_the_centre_none) {
  constexpr size_t side = 90, windows[][2] = {{7, 7}, {9, 7}, {7, 9}, {3, 3}, {5, 5}, {65, 1}, {1, 65}, {13, 5}};
  for (const auto& [w, h] : windows) {
    std::vector<uint8_t> image(side * side, 100);
    const auto at_centre = [&] { return census({image.data(), side}, side, side, window(w, h)).at(45, 45); };
    const uint64_t even = at_centre();
    EXPECT_EQ(std::popcount(even), static_cast<int>((w * h - 1) / 2)) << "equal pixels give 1";
    uint64_t cleared = 0;
    for (size_t k = 0; k < w * h; ++k) {
      uint8_t& pixel = image[(45 - h / 2 + k / w) * side + 45 - w / 2 + k % w];
      pixel = k < w * h / 2 ? 99 : 101;  // first pixel of a pair darker, or second one brighter
      const uint64_t flipped = even ^ at_centre();
      EXPECT_EQ(std::popcount(flipped), k == w * h / 2 ? 0 : 1) << w << "x" << h << " position " << k;
      cleared |= flipped;
      pixel = 100;
    }
    EXPECT_EQ(cleared, even) << w << "x" << h;
  }
}

TEST(census, three_by_three_by_hand) {
  const std::vector<uint8_t> image = {10, 20, 30,  //
                                      40, 50, 60,  //
                                      70, 15, 30};
  const auto bits = census({image.data(), 3}, 3, 3, window(3, 3));
  // centre: 10>=30 no, 20>=15 yes, 30>=70 no, 40>=60 no
  EXPECT_EQ(bits.at(1, 1), 0b0010u);
  // top left, zeros outside: 0>=50 no, 0>=40 no, 0>=0 yes, 0>=20 no
  EXPECT_EQ(bits.at(0, 0), 0b0100u);
  // bottom right: 50>=0, 60>=0, 0>=0, 15>=0
  EXPECT_EQ(bits.at(2, 2), 0b1111u);
}

TEST(census, a_difference_counts_from_its_share_of_the_contrast_on) {
  constexpr size_t side = 21, centre = 10;
  constexpr uint32_t contrast = 64;  // a quarter
  std::vector<uint8_t> image(side * side, 100);
  image[(centre - 5) * side + centre + 5] = 140;  // at the corner of what is looked at: window 7x7 and two pixels around
  const auto at_centre = [&](simsense::CensusKind kind) {
    return census({image.data(), side}, side, side, window(7, 7, kind, contrast)).at(10, 10);
  };
  const auto symmetric = [&] { return at_centre(simsense::CensusKind::center_symmetric); };
  const auto plain = [&] { return at_centre(simsense::CensusKind::plain); };
  EXPECT_EQ(symmetric(), 0u) << "equal pixels give 0";
  for (size_t k = 0; k < 49; ++k) {
    if (k == 24) continue;
    const size_t pair = std::min(k, 48 - k);
    const bool brighter_counts =
        (pair % 2 == 0) == (k < 24);  // in even pairs the first pixel has to be the brighter one, in odd ones the second
    uint8_t& pixel = image[(centre - 3 + k / 7) * side + centre - 3 + k % 7];
    pixel = 110;
    EXPECT_EQ(symmetric(), 0u) << "a quarter is not enough, position " << k;
    pixel = 111;
    EXPECT_EQ(symmetric(), brighter_counts ? uint64_t{1} << pair : 0u) << "position " << k;
    EXPECT_EQ(plain(), 0u) << "brighter than the centre, position " << k;
    pixel = 87;  // now 53 between darkest and brightest
    EXPECT_EQ(symmetric(), 0u) << "position " << k;
    pixel = 86;
    EXPECT_EQ(symmetric(), brighter_counts ? 0u : uint64_t{1} << pair) << "position " << k;
    EXPECT_EQ(plain(), uint64_t{1} << (k < 24 ? k : k - 1)) << "position " << k;
    pixel = 100;
  }
}

TEST(census, noise_on_a_dark_surface_sets_no_bit) {
  std::mt19937 random(7);
  std::vector<uint8_t> image(24 * 20);
  for (uint8_t& count : image) count = static_cast<uint8_t>(10 + random() % 5);  // differences of at most 4
  MatchParameters p = window(7, 7, CensusKind::center_symmetric, 16);
  const auto bits = [&] {
    int count = 0;
    for (const uint64_t word : census({image.data(), 24}, 24, 20, p).data) count += std::popcount(word);
    return count;
  };
  EXPECT_GT(bits(), 0) << "a share of the range alone lets noise speak";
  p.census_noise_dn = 3;
  EXPECT_GT(bits(), 0) << "differences of 4 are more than 3";
  p.census_noise_dn = 4;
  EXPECT_EQ(bits(), 0);
  p.census_contrast_256ths = 0;
  EXPECT_GT(bits(), 0) << "without a contrast every count tells";
}

TEST(census, contrast_is_relative) {
  // counts a * i + b have the words of i: gain and black level of an imager do not matter, up to its edge
  std::mt19937 random(3);
  std::vector<uint16_t> image(24 * 20), scaled(image.size());
  for (size_t i = 0; i < image.size(); ++i) {
    image[i] = static_cast<uint16_t>(random() % 256);
    scaled[i] = static_cast<uint16_t>(image[i] * 251 + 900);
  }
  const auto words = [](const std::vector<uint16_t>& counts, simsense::CensusKind kind) {
    return census({reinterpret_cast<const uint8_t*>(counts.data()), 24, 2}, 24, 20, window(7, 5, kind, 26)).data;
  };
  for (const auto kind : {simsense::CensusKind::center_symmetric, simsense::CensusKind::plain})
    EXPECT_EQ(words(image, kind), words(scaled, kind));
}

TEST(plain_census, every_pixel_but_the_centre_is_one_bit) {
  constexpr size_t side = 20;
  std::vector<uint8_t> image(side * side, 100);
  const auto at_centre = [&] { return census({image.data(), side}, side, side, window(9, 7, CensusKind::plain)).at(10, 10); };
  EXPECT_EQ(at_centre(), 0u) << "equal pixels give 0";
  uint64_t all = 0;
  for (size_t k = 0; k < 63; ++k) {
    uint8_t& pixel = image[(10 - 3 + k / 9) * side + 10 - 4 + k % 9];
    pixel = k == 31 ? 101 : 99;  // the centre brighter than all, or another one darker
    EXPECT_EQ(std::popcount(at_centre()), k == 31 ? 62 : 1);
    if (k != 31) all |= at_centre();
    pixel = 100;
  }
  EXPECT_EQ(std::popcount(all), 62);
}

TEST(census, sixteen_bits_tell_apart_what_eight_do_not) {
  std::vector<uint16_t> image(25, 1000);
  image[6] = 1001;  // first of a pair with its mirror 18
  image[18] = 1002;
  const ConstImage wide{reinterpret_cast<const uint8_t*>(image.data()), 5, 2};
  EXPECT_EQ(census(wide, 5, 5, window(3, 3)).at(2, 2), 0b1110u);
}

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
  const auto cost = volume(1, 1, 6, {90, 60, 30, 35, 40, 80});
  EXPECT_FLOAT_EQ(confidence(cost).data[0], 1.0f - 30.0f / 40.0f);
  EXPECT_GE(left_winner(cost, 25, Subpixel::none, nullptr).data[0], 0.0f);
  EXPECT_EQ(left_winner(cost, 26, Subpixel::none, nullptr).data[0], -1.0f);
  EXPECT_EQ(confidence(volume(1, 1, 6, {0, 0, 0, 0, 0, 0})).data[0], 0.0f);
}

TEST(equiangular_summed, looks_at_the_aggregated_costs_alone) {
  const auto summed = volume(1, 1, 5, {90, 60, 10, 50, 90}), block = volume(1, 1, 5, {9, 8, 2, 6, 9});
  EXPECT_FLOAT_EQ(left_winner(summed, 0, Subpixel::equiangular_summed, &block).data[0], 2.0f + (60 - 50) / 100.0f);
}

}  // namespace
