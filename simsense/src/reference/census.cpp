#include "reference/census.h"

namespace simsense::reference {

Grid<uint32_t> census(ConstImage image, size_t width, size_t height, size_t window_width, size_t window_height) {
  const ptrdiff_t half_width = static_cast<ptrdiff_t>(window_width / 2), half_height = static_cast<ptrdiff_t>(window_height / 2);
  const auto pixel = [&](ptrdiff_t x, ptrdiff_t y) -> int {
    if (x < 0 || y < 0 || x >= static_cast<ptrdiff_t>(width) || y >= static_cast<ptrdiff_t>(height)) return 0;
    return image.data[y * image.row_stride + x];
  };
  const size_t pair_count = (window_width * window_height - 1) / 2;
  Grid<uint32_t> bits(width, height);
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      for (size_t pair = 0; pair < pair_count; ++pair) {
        const ptrdiff_t dx = static_cast<ptrdiff_t>(pair % window_width) - half_width;
        const ptrdiff_t dy = static_cast<ptrdiff_t>(pair / window_width) - half_height;
        const ptrdiff_t cx = static_cast<ptrdiff_t>(x), cy = static_cast<ptrdiff_t>(y);
        if (pixel(cx + dx, cy + dy) >= pixel(cx - dx, cy - dy)) bits.at(x, y) |= 1u << pair;
      }
    }
  }
  return bits;
}

}  // namespace simsense::reference
