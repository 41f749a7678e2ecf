// SPDX-License-Identifier: Apache-2.0
#include "gbuffer/gbuffer_light.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "material/texels.h"

namespace kuafu {
namespace {

constexpr double widest_px = 64.0;

struct Plane {
  std::vector<double> values;
  int width = 0, height = 0;
};

Plane plane_of(const Texture& pattern) {
  const PatternPlane packed = pattern_plane(pattern);
  Plane plane{std::vector<double>(size_t(pattern.width) * pattern.height), int(pattern.width), int(pattern.height)};
  const uint32_t in_word = 32 / packed.bits;
  for (size_t i = 0; i < plane.values.size(); ++i) {
    const uint32_t word = packed.words[i / in_word];
    if (packed.bits == 32) {
      plane.values[i] = double(std::bit_cast<float>(word));
      continue;
    }
    const uint32_t most = (1u << packed.bits) - 1;
    plane.values[i] = double(word >> (i % in_word * packed.bits) & most) / most;
  }
  return plane;
}

/// Sums of the first x pixels of each row, [height][width + 1].
std::vector<double> row_sums(const Plane& plane) {
  std::vector<double> sums(size_t(plane.width + 1) * plane.height);
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x)
      sums[size_t(y) * (plane.width + 1) + x + 1] = sums[size_t(y) * (plane.width + 1) + x] + plane.values[size_t(y) * plane.width + x];
  return sums;
}

/// A row's integral from its left border to x; pixel i spans i - 0.5 .. i + 0.5.
double integral(const double* sums, int width, double x) {
  const double at = std::clamp(x + 0.5, 0.0, double(width));
  const int i = std::min(int(at), width - 1);
  return sums[i] + (at - i) * (sums[i + 1] - sums[i]);
}

/// One row of a kernel: how far it reaches to either side, and what it weighs.
struct Chord {
  double half_px, weight;
};

/// A disc's chords through the rows from -n to n, in eighths of a row.
std::vector<std::vector<Chord>> chords_of(double diameter_px) {
  constexpr int parts = 8;
  const double radius = diameter_px / 2;
  const int reach = int(std::ceil(radius - 0.5));
  std::vector<std::vector<Chord>> rows;
  double area = 0;
  for (int y = -reach; y <= reach; ++y) {
    std::vector<Chord> row;
    for (int part = 0; part < parts; ++part) {
      const double offset = y - 0.5 + (part + 0.5) / parts, square = radius * radius - offset * offset;
      if (square <= 0) continue;
      row.push_back({std::sqrt(square), 1.0});
      area += 2 * row.back().half_px;
    }
    rows.push_back(row);
  }
  for (auto& row : rows)
    for (Chord& chord : row) chord.weight /= area;
  return rows;
}

/// The plane under a disc; what lies beyond its border is dark.
Plane through_disc(const Plane& plane, double diameter_px, ks::ThreadPool& workers) {
  const auto sums = row_sums(plane);
  const auto rows = chords_of(diameter_px);
  const int reach = int(rows.size()) / 2;
  Plane out{std::vector<double>(plane.values.size()), plane.width, plane.height};
  workers.parallel_for(size_t(plane.height), [&](size_t line) {
    double* to = &out.values[line * plane.width];
    for (int dy = -reach; dy <= reach; ++dy) {
      const int y = int(line) + dy;
      if (y < 0 || y >= plane.height) continue;
      const double* from = &sums[size_t(y) * (plane.width + 1)];
      for (const Chord& chord : rows[size_t(dy + reach)])
        for (int x = 0; x < plane.width; ++x)
          to[x] += chord.weight * (integral(from, plane.width, x + chord.half_px) - integral(from, plane.width, x - chord.half_px));
    }
  });
  return out;
}

/// The side of the box whose means, looked up between `step` apart, spread a point as a pixel's square on the interpolated pattern does:
/// (1 + box^2) / 12 + step^2 / 6 = 1 / 6 + pixel^2 / 12, in variances.
double box_side(double pixel_px, double step_px) {
  return std::sqrt(std::max(1.0 + pixel_px * pixel_px - 2.0 * step_px * step_px, 0.0625));
}

}  // namespace

PatternStack pattern_stack(const Texture& pattern, glm::dvec2 pixel_px, double most_diameter_px, ks::ThreadPool& workers) {
  const Plane sharp = plane_of(pattern);
  PatternStack stack;
  const double step = std::max(1.0, std::floor(std::min(pixel_px.x, pixel_px.y) / 2.0));
  stack.step_px = float(step);
  stack.width = uint32_t((sharp.width - 1) / step) + 3;
  stack.height = uint32_t((sharp.height - 1) / step) + 3;
  const double most = std::clamp(most_diameter_px, 0.0, widest_px);
  stack.levels = most <= 0 ? 1 : 2 + uint32_t(std::ceil(2.0 * std::log2(std::max(most, 1.0))));
  const size_t count = size_t(stack.width) * stack.height;
  stack.means.resize(stack.levels * count);
  const glm::dvec2 box(box_side(pixel_px.x, step), box_side(pixel_px.y, step));
  for (uint32_t level = 0; level < stack.levels; ++level) {
    const Plane plane = level == 0 ? sharp : through_disc(sharp, std::exp2(0.5 * (level - 1)), workers);
    const auto sums = row_sums(plane);
    workers.parallel_for(stack.height, [&](size_t line) {
      const double v = (double(line) - 1.0) * step, top = v - box.y / 2, bottom = v + box.y / 2;
      for (int y = std::max(int(std::floor(top + 0.5)), 0); y <= std::min(int(std::floor(bottom + 0.5)), plane.height - 1); ++y) {
        const double part = std::min(bottom, y + 0.5) - std::max(top, y - 0.5);
        if (part <= 0) continue;
        const double* from = &sums[size_t(y) * (plane.width + 1)];
        for (uint32_t column = 0; column < stack.width; ++column) {
          const double u = (double(column) - 1.0) * step;
          stack.means[level * count + line * stack.width + column] +=
              float(part / (box.x * box.y) * (integral(from, plane.width, u + box.x / 2) - integral(from, plane.width, u - box.x / 2)));
        }
      }
    });
  }
  return stack;
}

}  // namespace kuafu
