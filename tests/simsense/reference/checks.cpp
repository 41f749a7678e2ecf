// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/checks.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace simsense::reference {

Grid<float> left_right_check(const Grid<float>& left, const Grid<uint32_t>& right, int32_t max_diff, int32_t min_disparity,
                             Grid<MatchReason>* reason) {
  const auto note = [&](size_t x, size_t y, MatchReason why) {
    if (reason) reason->at(x, y) = why;
  };
  Grid<float> checked(left.width, left.height, -1.0f);
  for (size_t y = 0; y < left.height; ++y) {
    for (size_t x = 0; x < left.width; ++x) {
      const float disparity = left.at(x, y);
      if (disparity < 0.0f) continue;
      const int rounded = static_cast<int>(std::floor(disparity + 0.5f));
      const int right_x = static_cast<int>(x) - rounded - min_disparity;
      if (right_x < 0 || right_x >= static_cast<int>(left.width)) {
        note(x, y, MatchReason::outside);
        continue;
      }
      const int right_disparity = static_cast<int>(right.at(static_cast<size_t>(right_x), y));
      if (std::abs(rounded - right_disparity) <= max_diff) {
        checked.at(x, y) = disparity;
      } else {
        note(x, y, MatchReason::occluded);
      }
    }
  }
  return checked;
}

Grid<float> median(const Grid<float>& disparity, size_t size) {
  const size_t half = size / 2;
  Grid<float> filtered = disparity;
  std::vector<float> window(size * size);
  for (size_t y = half; y + half < disparity.height; ++y) {
    for (size_t x = half; x + half < disparity.width; ++x) {
      for (size_t k = 0; k < window.size(); ++k) window[k] = disparity.at(x + k % size - half, y + k / size - half);
      std::nth_element(window.begin(), window.begin() + static_cast<ptrdiff_t>(window.size() / 2), window.end());
      filtered.at(x, y) = window[window.size() / 2];
    }
  }
  return filtered;
}

}  // namespace simsense::reference
