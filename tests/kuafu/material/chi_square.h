// SPDX-License-Identifier: Apache-2.0
// Chi-square over the sphere of directions: what a sampler draws, in cells of equal solid angle, against its density.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/glm.hpp>
#include <numbers>
#include <vector>

namespace kuafu::test {

inline glm::vec3 direction(double cosine, double phi) {
  const double s = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  return {float(s * std::cos(phi)), float(s * std::sin(phi)), float(cosine)};
}

class ChiSquare {
 public:
  static constexpr int samples = 200000;

  void count(const glm::vec3& d) {
    const double phi = std::atan2(d.y, d.x), turn = phi < 0 ? phi + full_turn : phi;
    counts_[size_t(std::min(rows - 1, int((d.z + 1) / 2 * rows))) * columns +
            size_t(std::min(columns - 1, int(turn / full_turn * columns)))] += 1;
  }

  /// Five standard deviations, and `slack` of each sample for the quadrature of edges and narrow lobes. Returns the density's integral.
  double expect(const std::function<double(glm::vec3)>& density, double slack) const {
    constexpr int sub = 20;
    const double cell = 2.0 / (rows * sub) * full_turn / (columns * sub);
    std::vector<double> expected(counts_.size());
    double total = 0, sum = 0, rest_counted = 0, rest_expected = 0;
    for (int r = 0; r < rows * sub; ++r)
      for (int c = 0; c < columns * sub; ++c) {
        const double p = cell * density(direction(-1 + 2 * (r + 0.5) / (rows * sub), full_turn * (c + 0.5) / (columns * sub)));
        expected[size_t(r / sub) * columns + size_t(c / sub)] += samples * p;
        total += p;
      }
    int cells = 0;
    for (size_t i = 0; i < counts_.size(); ++i) {
      if (expected[i] < 10) {
        rest_counted += counts_[i], rest_expected += expected[i];
        continue;
      }
      sum += (counts_[i] - expected[i]) * (counts_[i] - expected[i]) / expected[i];
      ++cells;
    }
    EXPECT_GT(cells, 5);
    EXPECT_LT(sum, cells + 5 * std::sqrt(2.0 * cells) + slack * samples) << cells << " cells";
    EXPECT_LT(std::abs(rest_counted - rest_expected), 5 * std::sqrt(rest_expected + 10) + 2e-3 * samples);
    return total;
  }

 private:
  static constexpr int rows = 24, columns = 32;
  static constexpr double full_turn = 2 * std::numbers::pi;
  std::vector<double> counts_ = std::vector<double>(size_t(rows) * columns);
};

}  // namespace kuafu::test
