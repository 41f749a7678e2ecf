// SPDX-License-Identifier: Apache-2.0
// Quantiles of the gamma distribution, and a table of them for a fixed shape, read at standard normal numbers.
#pragma once

#include <vector>

namespace simsense {

/// Returns x with P(Gamma(shape, 1) <= x) = Phi(z), to about 1e-12 relative (1e-6 for shapes above 1e4). Precise in both tails.
double gamma_quantile(double shape, double z);

/// A table of cube roots of Gamma(shape, scale) quantiles over z. They are nearly straight lines (Wilson and Hilferty, PNAS 17, 1931), so
/// linear interpolation errs by 1e-5 of the mean.
class GammaTable {
 public:
  static constexpr float z_min = -6.5f, z_max = 6.5f;
  static constexpr int interval_count = 1024;
  struct Interval {
    float start, slope;  // at the lower end; over the whole interval
  };

  GammaTable() = default;
  GammaTable(double shape, double scale);

  [[nodiscard]] bool empty() const { return intervals_.empty(); }
  /// The intervals, [interval_count + 1]; the last one starts at z_max.
  [[nodiscard]] const Interval* intervals() const { return intervals_.data(); }

 private:
  std::vector<Interval> intervals_;
};

}  // namespace simsense
