// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/census.h"

#include <algorithm>
#include <utility>

namespace simsense::reference {
namespace {

struct Window {
  ConstImage image;
  ptrdiff_t width, height, x, y;
  bool repeats_edge;

  [[nodiscard]] int pixel(ptrdiff_t dx, ptrdiff_t dy) const {
    const ptrdiff_t px = std::clamp<ptrdiff_t>(x + dx, 0, width - 1), py = std::clamp<ptrdiff_t>(y + dy, 0, height - 1);
    const bool outside = px != x + dx || py != y + dy;
    return outside && !repeats_edge ? 0 : static_cast<int>(image.at(px, py));
  }
  /// Largest less smallest count, up to half_width columns and half_height rows away.
  [[nodiscard]] int range(ptrdiff_t half_width, ptrdiff_t half_height) const {
    int low = pixel(0, 0), high = low;
    for (ptrdiff_t dy = -half_height; dy <= half_height; ++dy) {
      for (ptrdiff_t dx = -half_width; dx <= half_width; ++dx) {
        low = std::min(low, pixel(dx, dy));
        high = std::max(high, pixel(dx, dy));
      }
    }
    return high - low;
  }
};

}  // namespace

Grid<uint64_t> census(ConstImage image, size_t width, size_t height, const MatchParameters& p) {
  constexpr ptrdiff_t margin = MatchParameters::contrast_margin;
  const ptrdiff_t half_width = p.census_width / 2, half_height = p.census_height / 2;
  const size_t cell_count = size_t{p.census_width} * p.census_height;
  const bool plain = p.census_kind == CensusKind::plain, with_contrast = p.census_contrast_256ths > 0;
  Grid<uint64_t> words(width, height);
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      const Window window{
          image,        static_cast<ptrdiff_t>(width), static_cast<ptrdiff_t>(height), static_cast<ptrdiff_t>(x), static_cast<ptrdiff_t>(y),
          with_contrast};
      const int share =
          with_contrast ? static_cast<int>(p.census_contrast_256ths) * window.range(half_width + margin, half_height + margin) : 0;
      const int needed = with_contrast ? std::max(share, 256 * static_cast<int>(p.census_noise_dn)) : 0;
      size_t bit = 0;
      for (size_t cell = 0; cell < cell_count; ++cell) {
        if (cell == cell_count / 2) {  // the centre; what follows are mirrors
          if (!plain) break;
          continue;
        }
        const ptrdiff_t dx = static_cast<ptrdiff_t>(cell % p.census_width) - half_width;
        const ptrdiff_t dy = static_cast<ptrdiff_t>(cell / p.census_width) - half_height;
        int brighter = plain ? window.pixel(0, 0) : window.pixel(dx, dy), darker = plain ? window.pixel(dx, dy) : window.pixel(-dx, -dy);
        if (!plain && with_contrast && bit % 2 == 1) std::swap(brighter, darker);
        const bool equal_counts = !plain && !with_contrast;
        const bool set = equal_counts ? brighter >= darker : 256 * (brighter - darker) > needed;
        words.at(x, y) |= uint64_t{set} << bit++;
      }
    }
  }
  return words;
}

}  // namespace simsense::reference
