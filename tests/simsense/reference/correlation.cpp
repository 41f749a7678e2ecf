// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/correlation.h"

#include <algorithm>
#include <array>
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
  const uint32_t side = std::max(3u, 3 * window / 10 | 1);
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
  struct Sums {
    int32_t both = 0, left = 0, right = 0, pixels = 0;
  };
  const auto sums_around = [&](size_t x, size_t y, uint32_t side) {
    Sums sums;
    around(x, y, side, [&](ptrdiff_t u, ptrdiff_t v) {
      const auto beyond = [](ptrdiff_t at, size_t size) { return at < 0 || at >= static_cast<ptrdiff_t>(size); };
      if (beyond(u, width) || beyond(v, height)) return;
      const auto column = static_cast<size_t>(u), row = static_cast<size_t>(v);
      const float d = disparity.at(column, row);
      const ptrdiff_t match = u - static_cast<ptrdiff_t>(std::floor(d + 0.5f));
      if (d == p.invalid_disparity() || beyond(match, width)) return;
      const int32_t a = l.at(column, row), b = r.at(static_cast<size_t>(match), row);
      sums.both += a * b;
      sums.left += a * a;
      sums.right += b * b;
      sums.pixels += a != 0 || b != 0;
    });
    return sums;
  };
  const auto in_floats = [](const Sums& sums) {
    return std::array{static_cast<float>(sums.both), static_cast<float>(sums.left) * static_cast<float>(sums.right),
                      static_cast<float>(sums.pixels)};
  };
  const uint32_t side = p.correlation_window;
  Grid<uint8_t> out(width, height, 1), bare(width, height, 0);
  for (size_t y = 0; y < height; ++y)
    for (size_t x = 0; x < width; ++x) {
      const bool is_found = disparity.at(x, y) != p.invalid_disparity();
      const auto [both, all, pixels] = in_floats(sums_around(x, y, side));
      const auto [near_both, near_all, near_pixels] = in_floats(sums_around(x, y, side / 2 | 1));
      const float least = p.min_correlation * p.min_correlation * static_cast<float>(side * side) * all;
      const bool is_wide = both > 0 && both * both * pixels >= least;
      const float near = near_both * std::fabs(near_both) * near_pixels + 2.25f * near_all;
      const bool is_near = near * all > 0.04f * (both * both) * near_all * near_pixels;
      bare.at(x, y) = !is_near && (is_found || near_pixels > 0);
      out.at(x, y) = !is_found || (is_wide && is_near);
    }
  const uint32_t reach = side / 2 / 2 + std::max(3u, 3 * side / 10 | 1) / 2 + 1;
  for (size_t y = 1; y + 1 < height; ++y)
    for (size_t x = 1; x + 1 < width; ++x) {
      bool is_bare = true;
      const auto inside = [&](ptrdiff_t u, ptrdiff_t v) {
        return u >= 0 && v >= 0 && u < static_cast<ptrdiff_t>(width) && v < static_cast<ptrdiff_t>(height);
      };
      around(x, y, 3, [&](ptrdiff_t u, ptrdiff_t v) { is_bare &= bare.at(static_cast<size_t>(u), static_cast<size_t>(v)) != 0; });
      if (!is_bare) continue;
      around(x, y, 2 * reach + 1, [&](ptrdiff_t u, ptrdiff_t v) {
        if (!inside(u, v)) return;
        const auto column = static_cast<size_t>(u), row = static_cast<size_t>(v);
        if (disparity.at(column, row) != p.invalid_disparity()) out.at(column, row) = 0;
      });
    }
  return out;
}

}  // namespace simsense::reference
