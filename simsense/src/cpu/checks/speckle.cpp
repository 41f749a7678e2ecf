// SPDX-License-Identifier: Apache-2.0
#include "cpu/checks/checks.h"

#include <algorithm>
#include <cmath>

namespace simsense {

uint32_t SpeckleFilter::root(uint32_t pixel) {
  while (parent_[pixel] != pixel) {
    parent_[pixel] = parent_[parent_[pixel]];
    pixel = parent_[pixel];
  }
  return pixel;
}

void SpeckleFilter::join(uint32_t a, uint32_t b) {
  a = root(a);
  b = root(b);
  parent_[std::max(a, b)] = std::min(a, b);
}

void SpeckleFilter::apply(const MatchMaps& maps, uint32_t width, uint32_t height, float invalid, uint32_t max_size, float max_diff_px,
                          ks::ThreadPool& workers) {
  constexpr uint32_t band_rows = 32;
  const uint32_t pixels = width * height;
  parent_.resize(pixels);
  size_.assign(pixels, 0);
  const float* disparity = maps.disparity;
  const auto connected = [&](uint32_t a, uint32_t b) {
    return disparity[a] != invalid && disparity[b] != invalid && std::abs(disparity[a] - disparity[b]) <= max_diff_px;
  };
  const auto join_rows = [&](uint32_t y) {  // row y with the one above
    for (uint32_t i = y * width; i < (y + 1) * width; ++i)
      if (connected(i, i - width)) join(i, i - width);
  };
  workers.parallel_for((height + band_rows - 1) / band_rows, [&](size_t band) {
    const auto first = static_cast<uint32_t>(band) * band_rows;
    for (uint32_t y = first; y < std::min(height, first + band_rows); ++y) {
      for (uint32_t i = y * width; i < (y + 1) * width; ++i) {
        parent_[i] = i;
        if (i > y * width && connected(i, i - 1)) join(i, i - 1);
      }
      if (y > first) join_rows(y);
    }
  });
  for (uint32_t y = band_rows; y < height; y += band_rows) join_rows(y);
  for (uint32_t i = 0; i < pixels; ++i) {
    parent_[i] = root(i);
    ++size_[parent_[i]];
  }
  workers.parallel_for(height, [&](size_t y) {
    for (size_t i = y * width; i < (y + 1) * width; ++i) {
      if (maps.disparity[i] == invalid || size_[parent_[i]] > max_size) continue;
      maps.reject(i, invalid, MatchReason::speckle);
    }
  });
}

}  // namespace simsense
