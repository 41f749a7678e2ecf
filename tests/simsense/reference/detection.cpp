// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/detection.h"

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
  const uint32_t side = std::max(window < 13 ? 3u : 5u, 3 * window / 10 | 1);
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
      out.at(x, y) = std::clamp((eighths * ((65536 + area / 2) / area) + 32768) >> 16, -63, 63);
    }
  return out;
}

}  // namespace

Grid<uint8_t> detects(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p,
                      const DetectionNoise& noise) {
  const size_t width = disparity.width, height = disparity.height;
  const uint32_t side = p.detection_window;
  const auto l = high_pass(left, p.left_bits, width, height, side);
  const auto r = high_pass(right, p.right_bits, width, height, side);
  Grid<uint8_t> out(width, height, 1), bare(width, height, 0);
  for (size_t y = 0; y < height; ++y)
    for (size_t x = 0; x < width; ++x) {
      int64_t energy = 0, expected = 0, pixels = 0;
      around(x, y, side, [&](ptrdiff_t u, ptrdiff_t v) {
        const auto beyond = [](ptrdiff_t at, size_t size) { return at < 0 || at >= static_cast<ptrdiff_t>(size); };
        if (beyond(u, width) || beyond(v, height)) return;
        const auto column = static_cast<size_t>(u), row = static_cast<size_t>(v);
        const float d = disparity.at(column, row);
        const ptrdiff_t match = u - static_cast<ptrdiff_t>(std::floor(d + 0.5f));
        if (d == p.invalid_disparity() || beyond(match, width)) return;
        const int64_t both = l.at(column, row) + r.at(static_cast<size_t>(match), row);
        const int64_t count = refine_count(left.at(u, v), left.element_bytes, p.left_bits) >> (left.element_bytes == 1 ? 0 : 4);
        const int64_t own = noise.dark + noise.per_count * count + noise.per_count2 * count * count;
        energy += both * both;
        expected += std::clamp<int64_t>(own >> 14, noise.least, 17000);
        ++pixels;
      });
      const auto usual = static_cast<float>(expected), excess = 4.0f * static_cast<float>(energy) - 1.14f * usual;
      const float least = 4.0f * p.min_detection_sigma * p.min_detection_sigma * (usual * usual) / 2.0f;
      const bool is_found = disparity.at(x, y) != p.invalid_disparity();
      const bool is_dense = side > 15 && 32 * energy > expected && pixels > int64_t{side} * side * (47 - side) / 32;
      const bool fails = !is_dense && !(excess > 0 && excess * excess * static_cast<float>(pixels) > least);
      bare.at(x, y) = fails && (is_found || pixels > 0);
      out.at(x, y) = !is_found || !fails;
    }
  const uint32_t reach = side / 2 + std::max(side < 13 ? 3u : 5u, 3 * side / 10 | 1) / 2 + 1;
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
