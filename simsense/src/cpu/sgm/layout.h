// SPDX-License-Identifier: Apache-2.0
// How an image is cut for the aggregation. Strips: as many rows as a vector has lanes, one horizontal path per lane. Groups: the rows of a
// strip whose upward paths are replayed from one checkpoint. Bands: consecutive strips worked on by one thread. Blocks: one vector of
// columns.
#pragma once

#include <algorithm>
#include <cstddef>

#include "cpu/simd/buffer.h"

namespace simsense::cpu {

struct Range {
  size_t begin = 0, end = 0;
  [[nodiscard]] size_t size() const { return end - begin; }
};

struct Layout {
  size_t width = 0, height = 0, disparities = 0, lanes = 0;
  size_t blocks = 0, bands = 0, strips = 0, groups_per_strip = 0;

  Layout(size_t width_, size_t height_, size_t disparities_, size_t lanes_, size_t threads)
      : width(width_), height(height_), disparities(disparities_), lanes(lanes_), blocks(round_up(width, lanes) / lanes) {
    constexpr size_t min_band_rows = 16, max_group_rows = 18;
    bands = std::min(threads, std::max<size_t>(1, height / min_band_rows));
    strips = round_up(round_up(height, lanes) / lanes, bands);
    groups_per_strip = round_up(max_strip_rows(), max_group_rows) / max_group_rows;
  }
  [[nodiscard]] size_t max_strip_rows() const { return round_up(height, strips) / strips; }
  [[nodiscard]] size_t max_group_rows() const { return round_up(max_strip_rows(), groups_per_strip) / groups_per_strip; }
  [[nodiscard]] size_t groups() const { return strips * groups_per_strip; }

  [[nodiscard]] Range strip(size_t s) const { return {height * s / strips, height * (s + 1) / strips}; }
  [[nodiscard]] Range band_strips(size_t b) const { return {strips * b / bands, strips * (b + 1) / bands}; }
  [[nodiscard]] size_t band_first_row(size_t b) const { return strip(band_strips(b).begin).begin; }
  [[nodiscard]] Range group(size_t g) const {
    const Range rows = strip(g / groups_per_strip);
    const size_t k = g % groups_per_strip;
    return {rows.begin + rows.size() * k / groups_per_strip, rows.begin + rows.size() * (k + 1) / groups_per_strip};
  }
  [[nodiscard]] Range columns(size_t block) const { return {block * lanes, std::min(width, (block + 1) * lanes)}; }
};

}  // namespace simsense::cpu
