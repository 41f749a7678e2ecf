// SPDX-License-Identifier: Apache-2.0
// The order of pixels in a wave, on the shaders' text compiled as C++: each pixel of each view once, whatever the order and the size.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "frame/host_language.h"
#include "pathtrace/wave_size.h"

namespace kuafu {
namespace {

#include "lib/pixels.glsl"

constexpr uint32_t views = 3;

WaveRange order(uint32_t width, uint32_t height, bool permuted) {
  WaveRange range{};
  range.width = width, range.height = height;
  range.block_count = width * height * views / pixel_block;
  range.block_stride = permuted ? permutation_stride(range.block_count) : 0;
  return range;
}

TEST(PixelOrder, holds_each_pixel_once) {
  for (const glm::uvec2 size : {glm::uvec2(64, 36), {40, 10}, {37, 8}, {848, 480}, {1, 1}})
    for (const bool permuted : {false, true}) {
      const WaveRange range = order(size.x, size.y, permuted);
      std::vector<int> seen(size_t(size.x) * size.y * views);
      for (uint32_t p = 0; p < seen.size(); ++p) {
        const Pixel pixel = wave_pixel(range, p);
        ASSERT_TRUE(pixel.view < views && pixel.row < size.y && pixel.column < size.x) << p;
        ++seen[(size_t(pixel.view) * size.y + pixel.row) * size.x + pixel.column];
      }
      EXPECT_EQ(std::ranges::count(seen, 1), ptrdiff_t(seen.size())) << size.x << " x " << size.y << (permuted ? ", permuted" : "");
    }
}

// A warp's rays should be neighbours: of 4 samples a pixel it has 8 pixels, 4 x 2.
TEST(PixelOrder, tiles_hold_neighbours) {
  const WaveRange range = order(64, 36, false);
  for (uint32_t first = 0; first < 64 * 36; first += 8)
    for (uint32_t i = 1; i < 8; ++i) {
      const Pixel a = wave_pixel(range, first), b = wave_pixel(range, first + i);
      EXPECT_TRUE(b.row - a.row < 2 && b.column - a.column < 4) << first << ", " << i;
    }
}

}  // namespace
}  // namespace kuafu
