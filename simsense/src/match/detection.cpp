// SPDX-License-Identifier: Apache-2.0
#include "match/detection.h"

namespace simsense {

DetectionNoise detection_noise(double dark, double per_count, double per_count2, double least, uint32_t mean_side) {
  constexpr double white = 255, most = 1 << 30;
  // a square of 8ths, in quarters, less the mean's part
  const double unit = 4 * 64 * (1 - 1.0 / (mean_side * mean_side)), fine = unit * (1 << DETECTION_NOISE_BITS);
  const double whole = fine * std::max(std::abs(dark), std::abs(dark) + std::abs(per_count) * white + std::abs(per_count2) * white * white);
  const double bounded = whole > most ? fine * most / whole : fine;
  const auto rounded = [](double value) { return static_cast<int32_t>(std::lround(value)); };
  return {rounded(bounded * dark), rounded(bounded * per_count), rounded(bounded * per_count2),
          std::clamp(rounded(std::min(unit * least, double{DETECTION_MOST_NOISE})), 1, DETECTION_MOST_NOISE)};
}

}  // namespace simsense
