// SPDX-License-Identifier: Apache-2.0
#include "cpu/registration/registration.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

namespace simsense {
namespace {
constexpr int32_t nothing = 0x7f800000;  // bits of +infinity

/// target = the least of `count` neighbours from each element on.
void least_across(const int32_t* __restrict from, size_t count, size_t size, int32_t* __restrict target) {
  std::copy_n(from, size, target);
  for (size_t k = 1; k < count; ++k)
    for (size_t x = 0; x < size; ++x) target[x] = std::min(target[x], from[x + k]);
}

void take_less(const int32_t* __restrict from, size_t size, int32_t* __restrict target) {
  for (size_t x = 0; x < size; ++x) target[x] = std::min(target[x], from[x]);
}

}  // namespace

/// Branchless, so that the compiler makes vectors of the loops around it. column, row: to be rounded down.
int32_t Registration::Cells::at(float column, float row, bool seen) const {
  seen = seen & (column >= -margin) & (row >= -margin) & (column < width + margin) & (row < height + margin);
  const float c = seen ? column : 0, r = seen ? row : 0;
  const auto whole = [](float v) { return static_cast<int32_t>(v) - (static_cast<float>(static_cast<int32_t>(v)) > v); };
  const int32_t cell = (whole(r) + SPLAT_MARGIN) * pitch + whole(c) + SPLAT_MARGIN;
  return seen ? cell : -1;
}

Registration::Cells Registration::cells() const {
  return {static_cast<float>(projection_.landing_margin()), static_cast<float>(projection_.width()),
          static_cast<float>(projection_.height()), static_cast<int32_t>(pitch())};
}

void Registration::project(const float* depth, size_t first, size_t count, uint32_t y, Landings& out) const {
  const std::array<float, 3> step = projection_.ray_step(), start = projection_.ray_start(y), t = projection_.translation();
  const auto [fx, fy] = projection_.focal_px();
  const auto [cx, cy] = projection_.centre_px();
  const bool splat_invalid = projection_.splats_invalid();
  const Cells cells = this->cells();
  std::array<float, chunk> nx, ny;
  for (size_t i = 0; i < count; ++i) {
    const float z = depth[first + i], u = static_cast<float>(first + i);
    out.z[i] = z * (step[2] * u + start[2]) + t[2];
    nx[i] = (z * (step[0] * u + start[0]) + t[0]) / out.z[i];
    ny[i] = (z * (step[1] * u + start[1]) + t[1]) / out.z[i];
  }
  if (const LensParameters& lens = projection_.lens(); lens.max_radius2 > 0) {
    for (size_t i = 0; i < count; ++i)
      if (!distort(lens, nx[i], ny[i])) out.z[i] = -1;
  }
  for (size_t i = 0; i < count; ++i) {
    const bool seen = ((depth[first + i] > 0) | splat_invalid) & (out.z[i] > 0);
    out.cell[i] = cells.at(fx * nx[i] + cx + 0.5f, fy * ny[i] + cy + 0.5f, seen);
  }
}

/// The published arithmetic: one multiply-add per coordinate, halves away from zero.
void Registration::project_unrectified(const float* depth, size_t first, size_t count, uint32_t y, Landings& out) const {
  const Cells cells = this->cells();
  for (size_t i = 0; i < count; ++i) {
    const float z = depth[first + i];
    float seen[3];
    for (size_t k = 0; k < 3; ++k) {
      const double* m = projection_.pixel_to_rgb().data() + 3 * k;
      seen[k] = std::fma(static_cast<float>(m[0] * static_cast<double>(first + i) + m[1] * y + m[2]), z, projection_.translation()[k]);
    }
    out.z[i] = seen[2];
    out.cell[i] =
        cells.at(std::round(seen[0] / seen[2]), std::round(seen[1] / seen[2]), (z > 0 || projection_.splats_invalid()) && seen[2] > 0);
  }
}

void Registration::keep_nearest(const Landings& landings, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    if (landings.cell[i] < 0) continue;
    std::atomic_ref<int32_t> cell(nearest_[static_cast<size_t>(landings.cell[i])]);
    const auto bits = std::bit_cast<int32_t>(landings.z[i]);
    int32_t seen = cell.load(std::memory_order_relaxed);
    while (bits < seen && !cell.compare_exchange_weak(seen, bits, std::memory_order_relaxed)) {
    }
  }
}

void Registration::splat_row(const float* depth, uint32_t y) {
  Landings landings;
  for (size_t first = 0; first < width_; first += chunk) {
    const size_t count = std::min(chunk, width_ - first);
    if (projection_.is_unrectified()) {
      project_unrectified(depth, first, count, y, landings);
    } else {
      project(depth, first, count, y, landings);
    }
    keep_nearest(landings, count);
  }
}

/// scratch: two rows of the z-buffer.
void Registration::resolve_row(const DepthRange& range, Splat splat, uint32_t y, int32_t* scratch, float* out) const {
  const size_t first = SPLAT_MARGIN - splat.reach();
  const int32_t* rows = nearest_.data() + (y + first) * pitch() + first;
  int32_t *below = scratch, *least = scratch + pitch();
  const size_t columns = projection_.width() + splat.size - 1;
  std::copy_n(rows, columns, below);
  for (size_t k = 1; k < splat.size; ++k) take_less(rows + k * pitch(), columns, below);
  least_across(below, splat.size, projection_.width(), least);
  for (size_t x = 0; x < projection_.width(); ++x) out[x] = range.keep(std::bit_cast<float>(least[x]));  // which infinity is not within
}

void Registration::apply(const float* depth, const DepthRange& range, Splat splat, float* out, ks::ThreadPool& workers) {
  std::fill(nearest_.begin(), nearest_.end(), nothing);
  workers.parallel_for(height_, [&](size_t y) { splat_row(depth + y * width_, static_cast<uint32_t>(y)); });
  constexpr size_t rows = 16;
  workers.parallel_for((projection_.height() + rows - 1) / rows, [&](size_t block) {
    std::vector<int32_t> scratch(2 * pitch());
    for (size_t y = block * rows; y < std::min<size_t>((block + 1) * rows, projection_.height()); ++y)
      resolve_row(range, splat, static_cast<uint32_t>(y), scratch.data(), out + y * projection_.width());
  });
}

}  // namespace simsense
