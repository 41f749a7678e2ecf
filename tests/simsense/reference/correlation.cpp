// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/correlation.h"

#include <algorithm>
#include <cmath>

#include "match/refine.h"

namespace simsense::reference {
namespace {

/// Visits the pixels of a square, those beyond the image, too.
template <class Visit>
void around(size_t x, size_t y, uint32_t side, Visit visit) {
  const auto reach = static_cast<ptrdiff_t>(side / 2);
  for (ptrdiff_t v = -reach; v <= reach; ++v)
    for (ptrdiff_t u = -reach; u <= reach; ++u) visit(static_cast<ptrdiff_t>(x) + u, static_cast<ptrdiff_t>(y) + v);
}

/// 8ths of a count above the mean of the square around.
Grid<int32_t> high_pass(ConstImage image, uint32_t bits, size_t width, size_t height, uint32_t window) {
  const uint32_t side = window / 2 | 1;
  const auto area = static_cast<int32_t>(side * side);
  const auto count = [&](ptrdiff_t x, ptrdiff_t y) {
    const ptrdiff_t column = std::clamp<ptrdiff_t>(x, 0, static_cast<ptrdiff_t>(width) - 1);
    const ptrdiff_t row = std::clamp<ptrdiff_t>(y, 0, static_cast<ptrdiff_t>(height) - 1);
    return static_cast<int32_t>(refine_count(image.at(column, row), image.element_bytes, bits));
  };
  Grid<int32_t> out(width, height);
  for (size_t y = 0; y < height; ++y)
    for (size_t x = 0; x < width; ++x) {
      int32_t sum = 0;
      around(x, y, side, [&](ptrdiff_t u, ptrdiff_t v) { sum += count(u, v); });
      int32_t eighths = 8 * (area * count(static_cast<ptrdiff_t>(x), static_cast<ptrdiff_t>(y)) - sum);
      eighths >>= image.element_bytes == 1 ? 0 : 4;
      out.at(x, y) = std::clamp((eighths * ((65536 + area / 2) / area) + 32768) >> 16, -127, 127);
    }
  return out;
}

}  // namespace

Grid<uint8_t> correlates(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p) {
  const size_t width = disparity.width, height = disparity.height;
  const auto l = high_pass(left, p.left_bits, width, height, p.correlation_window);
  const auto r = high_pass(right, p.right_bits, width, height, p.correlation_window);
  Grid<uint8_t> out(width, height, 1);
  for (size_t y = 0; y < height; ++y)
    for (size_t x = 0; x < width; ++x) {
      if (disparity.at(x, y) == p.invalid_disparity()) continue;
      int32_t both = 0, left_squares = 0, right_squares = 0;
      around(x, y, p.correlation_window, [&](ptrdiff_t u, ptrdiff_t v) {
        const auto beyond = [](ptrdiff_t at, size_t size) { return at < 0 || at >= static_cast<ptrdiff_t>(size); };
        if (beyond(u, width) || beyond(v, height)) return;
        const auto column = static_cast<size_t>(u), row = static_cast<size_t>(v);
        const float d = disparity.at(column, row);
        const ptrdiff_t match = u - static_cast<ptrdiff_t>(std::floor(d + 0.5f));
        if (d == p.invalid_disparity() || beyond(match, width)) return;
        const int32_t a = l.at(column, row), b = r.at(static_cast<size_t>(match), row);
        both += a * b;
        left_squares += a * a;
        right_squares += b * b;
      });
      const float least = p.min_correlation * p.min_correlation * static_cast<float>(left_squares) * static_cast<float>(right_squares);
      out.at(x, y) = both > 0 && static_cast<float>(both) * static_cast<float>(both) >= least;
    }
  return out;
}

}  // namespace simsense::reference
