// SPDX-License-Identifier: Apache-2.0
// Rejects measurements beside a step of disparity and matches at the right image's edges. Thread rule: externally synchronised.
#pragma once

#include <vector>

#include "checks/edges.h"
#include "match/matcher.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Applies EdgeParameters. The result does not depend on the number of workers.
class EdgeCheck {
 public:
  /// Rejects a valid pixel: sets its disparity to `invalid` and its confidence to 0. It does so if one of the eight neighbours is valid and
  /// further away by more than step_px (reason not_unique), or if the match lies within border_px of the right image's left or right edge
  /// (reason outside).
  void apply(const EdgeParameters& parameters, const MatchMaps& maps, uint32_t width, uint32_t height, float invalid,
             ks::ThreadPool& workers);

 private:
  std::vector<float> before_;  // [height][width]
};

}  // namespace simsense
