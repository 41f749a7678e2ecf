#include "reference/census.h"

namespace simsense::reference {

Grid<uint64_t> census(ConstImage image, size_t width, size_t height, size_t window_width, size_t window_height, CensusKind kind) {
  const ptrdiff_t half_width = static_cast<ptrdiff_t>(window_width / 2), half_height = static_cast<ptrdiff_t>(window_height / 2);
  const auto pixel = [&](ptrdiff_t x, ptrdiff_t y) -> uint32_t {
    if (x < 0 || y < 0 || x >= static_cast<ptrdiff_t>(width) || y >= static_cast<ptrdiff_t>(height)) return 0;
    return image.at(x, y);
  };
  const size_t cell_count = window_width * window_height;
  Grid<uint64_t> words(width, height);
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      size_t bit = 0;
      for (size_t cell = 0; cell < cell_count; ++cell) {
        if (cell == cell_count / 2) {  // the centre; what follows are mirrors
          if (kind == CensusKind::center_symmetric) break;
          continue;
        }
        const ptrdiff_t dx = static_cast<ptrdiff_t>(cell % window_width) - half_width;
        const ptrdiff_t dy = static_cast<ptrdiff_t>(cell / window_width) - half_height;
        const ptrdiff_t cx = static_cast<ptrdiff_t>(x), cy = static_cast<ptrdiff_t>(y);
        const bool set =
            kind == CensusKind::plain ? pixel(cx + dx, cy + dy) < pixel(cx, cy) : pixel(cx + dx, cy + dy) >= pixel(cx - dx, cy - dy);
        words.at(x, y) |= uint64_t{set} << bit++;
      }
    }
  }
  return words;
}

}  // namespace simsense::reference
