// SPDX-License-Identifier: Apache-2.0
// The census words of the scalar reference, by hand and by their laws.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "simsense/match/volumes.h"
#include "simsense/reference/census.h"

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

}  // namespace
