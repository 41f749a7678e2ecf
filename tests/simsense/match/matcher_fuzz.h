// SPDX-License-Identifier: Apache-2.0
// Random parameters and pairs for the matcher, and what tells two maps apart.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <sstream>

#include "simsense/match/stereo_pair.h"

namespace simsense_test {

using simsense::MatchParameters;

inline std::string describe(size_t width, size_t height, const MatchParameters& p) {
  std::ostringstream text;
  text << width << "x" << height << " D " << p.max_disparity << " census " << p.census_width << "x" << p.census_height << " block "
       << p.block_width << "x" << p.block_height << " p1 " << p.p1 << " p2 " << p.p2 << " uniqueness " << p.uniqueness_ratio << " lr "
       << p.lr_max_diff << " median " << p.median_size << " subpixel " << static_cast<int>(p.subpixel) << " plain "
       << (p.census_kind == simsense::CensusKind::plain) << " min " << p.min_disparity << " paths " << p.path_count << " gradient "
       << p.p2_full_gradient_dn << " contrast " << p.census_contrast_256ths << " noise " << p.census_noise_dn << " detection "
       << p.min_detection_sigma << " in " << p.detection_window;
  return text.str();
}

/// Every pixel equal, or where the first difference is.
template <class T>
void expect_same(const std::vector<T>& expected, const std::vector<T>& actual, size_t width, const std::string& what) {
  const auto [e, a] = std::mismatch(expected.begin(), expected.end(), actual.begin());
  if (e == expected.end()) return;
  const size_t at = static_cast<size_t>(e - expected.begin());
  size_t count = 0;
  for (size_t i = 0; i < expected.size(); ++i) count += expected[i] != actual[i];
  ADD_FAILURE() << what << ": " << count << " pixels differ, first at x " << at % width << " y " << at / width << ": expected "
                << static_cast<float>(*e) << ", got " << static_cast<float>(*a);
}

inline void expect_same(const Match& expected, const Match& actual, size_t width, const std::string& what) {
  expect_same(expected.disparity, actual.disparity, width, what + ": disparity");
  expect_same(expected.confidence, actual.confidence, width, what + ": confidence");
  expect_same(expected.reason, actual.reason, width, what + ": reason");
}

/// The largest sums of costs that 16 bits hold.
inline MatchParameters widest_sums() {
  MatchParameters p;
  p.p2 = 223;
  p.block_width = 15, p.block_height = 17;
  p.census_width = 65, p.census_height = 1;
  p.max_disparity = 40;
  return p;
}

class Fuzz {
 public:
  explicit Fuzz(unsigned seed) : random_(seed) {}
  uint32_t in(uint32_t low, uint32_t high) { return std::uniform_int_distribution<uint32_t>(low, high)(random_); }
  template <size_t n>
  uint32_t one_of(const uint32_t (&values)[n]) {
    return values[in(0, n - 1)];
  }
  MatchParameters parameters(bool block) {
    MatchParameters p;
    static constexpr uint32_t windows[][2] = {{7, 7}, {7, 7}, {9, 7}, {7, 9}, {5, 5}, {3, 3}, {65, 1}, {1, 65}, {13, 5}, {1, 1}};
    const auto& window = windows[in(0, 9)];
    p.census_width = window[0];
    p.census_height = window[1];
    p.max_disparity = in(0, 3) == 0 ? in(16, 300) : in(16, 70);
    static constexpr uint32_t blocks[][2] = {{7, 7}, {3, 5}, {5, 1}, {1, 9}, {15, 17}, {255, 1}, {1, 255}, {11, 3}};
    const auto& size = blocks[in(0, 7)];
    p.block_width = block ? size[0] : 1;
    p.block_height = block ? size[1] : 1;
    p.p2 = in(2, 223);
    p.p1 = in(1, p.p2 - 1);
    p.uniqueness_ratio = one_of({0, 5, 15, 40, 100});
    p.lr_max_diff = static_cast<int32_t>(in(0, 4)) - 1;
    p.median_size = one_of({1, 3, 5, 7});
    p.subpixel = static_cast<simsense::Subpixel>(in(0, 2));
    p.census_contrast_256ths = one_of({0, 1, 26, 32, 255});
    p.census_noise_dn = one_of({0, 0, 2, 30, 255});
    return p;
  }
  /// With what extends the published matcher.
  MatchParameters all_parameters(bool block) {
    MatchParameters p = parameters(block);
    if (in(0, 1)) {
      static constexpr uint32_t windows[][2] = {{9, 7}, {7, 9}, {7, 7}, {5, 5}, {7, 5}, {3, 3}, {63, 1}};
      const auto& window = windows[in(0, 6)];
      p.census_kind = simsense::CensusKind::plain;
      p.census_width = window[0];
      p.census_height = window[1];
      while (p.block_area() * (p.census_bits() + p.p2) > 65535) p.block_width = p.block_height = 3;
    }
    if (in(0, 2) > 0) p.min_disparity = static_cast<int32_t>(in(0, 60)) - 30;
    if (in(0, 5) == 0) p.min_disparity = static_cast<int32_t>(in(0, 400)) - 200;
    if (in(0, 1)) p.path_count = 8;
    if (in(0, 1)) p.p2_full_gradient_dn = in(1, 60);
    if (in(0, 3) == 0) p.subpixel = simsense::Subpixel::equiangular_summed;
    if (in(0, 2) == 0) p.subpixel = simsense::Subpixel::lucas_kanade;
    if (in(0, 2) == 0) p.min_detection_sigma = 0.1f * static_cast<float>(in(1, 300));
    p.detection_window = 2 * in(2, 15) + 1;
    return p;
  }
  StereoPair pair() {
    StereoPair pair = random_dots(in(32, 150), in(32, 100), in(0, 20), in(0, 25), in(0, 1u << 30));
    pair.noise = simsense::detection_noise(in(0, 60), 0.01 * in(0, 20), 0.00001 * in(0, 20), in(0, 1), 9);
    return pair;
  }

 private:
  std::mt19937 random_;
};

}  // namespace simsense_test
