// SPDX-License-Identifier: Apache-2.0
// Small volumes and maps for tests of the matcher's stages by hand.
#pragma once

#include <random>
#include <vector>

#include "simsense/reference/match.h"

namespace simsense::reference {

inline Volume<uint16_t> volume(size_t width, size_t height, size_t disparities, const std::vector<uint16_t>& values) {
  Volume<uint16_t> v(width, height, disparities);
  v.data = values;
  return v;
}

inline Volume<uint16_t> random_volume(size_t width, size_t height, size_t disparities, unsigned seed, unsigned max_cost) {
  std::mt19937 random(seed);
  Volume<uint16_t> v(width, height, disparities);
  for (uint16_t& value : v.data) value = static_cast<uint16_t>(random() % (max_cost + 1));
  return v;
}

inline Grid<float> grid(size_t width, size_t height, const std::vector<float>& values) {
  Grid<float> g(width, height);
  g.data = values;
  return g;
}

}  // namespace simsense::reference
