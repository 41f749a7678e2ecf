// SPDX-License-Identifier: Apache-2.0
// What both matchers' benchmarks share: the pair, and medians.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

namespace bench {

struct Pair {
  std::vector<uint8_t> left, right;
};

/// Dots on a slanted surface with steps, disparity 5 .. 100, uniform noise.
inline Pair dot_pair(uint32_t width, uint32_t height) {
  std::mt19937 random(1);
  Pair pair;
  std::vector<int> texture(width + 128);
  for (uint32_t y = 0; y < height; ++y) {
    for (int& value : texture) value = static_cast<int>(random() % 4 == 0 ? 90 + random() % 150 : 20 + random() % 30);
    const auto seen = [&](uint32_t at) {
      return static_cast<uint8_t>(std::clamp(texture[at] + static_cast<int>(random() % 11) - 5, 0, 255));
    };
    for (uint32_t x = 0; x < width; ++x) {
      pair.right.push_back(seen(x + 128));
      pair.left.push_back(seen(x + 128 - (5 + y / 8 + x / 240 * 9)));
    }
  }
  return pair;
}

inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace bench
