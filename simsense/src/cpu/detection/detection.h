// SPDX-License-Identifier: Apache-2.0
// The check that both images show more than noise (match/detection.h). Thread rule: externally synchronised.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "match/matcher.h"

namespace simsense::cpu {

class DetectionCheck {
 public:
  /// Rejects disparities of pixels that show only noise: sets their reason to low_texture and their confidence to 0. found: disparities
  /// [height][width] that the windows read, equal to maps.disparity before the call. The result does not depend on the number of workers.
  void apply(const MatchParameters& parameters, ConstImage left, ConstImage right, size_t width, size_t height, const float* found,
             const DetectionNoise& noise, const MatchMaps& maps, ks::ThreadPool& workers);

 private:
  std::vector<int8_t> high_[2];         // [height][width]
  std::vector<uint16_t> noise_energy_;  // the same, of the left image
  std::vector<uint8_t> bare_;           // the same: 1 where the window fails
};

}  // namespace simsense::cpu
