// SPDX-License-Identifier: Apache-2.0
#include "cpu/checks/checks.h"

#include <algorithm>
#include <limits>

namespace simsense {
namespace {

constexpr size_t window_reach = TextureParameters::window_reach, drop_reach = TextureParameters::drop_reach;

struct Rows {
  size_t begin, end;
};

/// Up to `reach` rows away, inside of the image.
Rows rows_around(size_t y, size_t height, size_t reach) { return {y - std::min(y, reach), std::min(height, y + reach + 1)}; }

/// Each of the first values becomes the pick of `count` values from it on: 1, 2, 4, ... at a time.
template <class T, class Pick>
void pick_neighbours(std::vector<T>& values, size_t count, Pick pick) {
  for (size_t picked = 1; picked < count;) {
    const size_t step = std::min(picked, count - picked);
    for (size_t x = 0; x + step < values.size(); ++x) values[x] = pick(values[x], values[x + step]);
    picked += step;
  }
}

template <class T>
T lower(T a, T b) {
  return std::min(a, b);
}

template <class T>
T higher(T a, T b) {
  return std::max(a, b);
}

/// Whether the squares about the pixels of some rows are blank.
template <class T>
void find_blank(uint32_t min_texture_dn, ConstImage left, size_t width, size_t height, Rows rows, uint8_t* blank) {
  std::vector<T> low, high;
  for (size_t y = rows.begin; y < rows.end; ++y) {
    // beyond the image stand values that are never picked
    low.assign(width + 2 * window_reach, std::numeric_limits<T>::max());
    high.assign(width + 2 * window_reach, T{0});
    const Rows around = rows_around(y, height, window_reach);
    for (size_t v = around.begin; v < around.end; ++v) {
      const T* counts = reinterpret_cast<const T*>(left.data) + static_cast<ptrdiff_t>(v) * left.row_stride;
      for (size_t x = 0; x < width; ++x) {
        low[window_reach + x] = std::min(low[window_reach + x], counts[x]);
        high[window_reach + x] = std::max(high[window_reach + x], counts[x]);
      }
    }
    pick_neighbours(low, 2 * window_reach + 1, lower<T>);
    pick_neighbours(high, 2 * window_reach + 1, higher<T>);
    for (size_t x = 0; x < width; ++x) blank[y * width + x] = uint32_t{high[x]} - low[x] < min_texture_dn;
  }
}

void drop_rows(const uint8_t* blank, size_t width, size_t height, Rows rows, const MatchMaps& maps, float invalid) {
  std::vector<uint8_t> drops;
  for (size_t y = rows.begin; y < rows.end; ++y) {
    drops.assign(width + 2 * drop_reach, 0);
    const Rows around = rows_around(y, height, drop_reach);
    for (size_t v = around.begin; v < around.end; ++v)
      for (size_t x = 0; x < width; ++x) drops[drop_reach + x] = std::max(drops[drop_reach + x], blank[v * width + x]);
    pick_neighbours(drops, 2 * drop_reach + 1, higher<uint8_t>);
    for (size_t x = 0; x < width; ++x) {
      const size_t at = y * width + x;
      if (!drops[x] || maps.disparity[at] == invalid) continue;
      maps.reject(at, invalid, MatchReason::low_texture);
    }
  }
}

}  // namespace

void TextureCheck::apply(const TextureParameters& p, ConstImage left, uint32_t width, uint32_t height, const MatchMaps& maps, float invalid,
                         ks::ThreadPool& workers) {
  constexpr size_t rows = 32;
  const auto for_rows = [&](const auto& run) {
    workers.parallel_for((height + rows - 1) / rows, [&](size_t i) { run(Rows{i * rows, std::min<size_t>(height, (i + 1) * rows)}); });
  };
  blank_.resize(size_t{width} * height);
  const auto find = left.element_bytes == 1 ? find_blank<uint8_t> : find_blank<uint16_t>;
  for_rows([&](Rows part) { find(p.min_texture_dn, left, width, height, part, blank_.data()); });
  for_rows([&](Rows part) { drop_rows(blank_.data(), width, height, part, maps, invalid); });
}

}  // namespace simsense
