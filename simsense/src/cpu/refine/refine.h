// SPDX-License-Identifier: Apache-2.0
// The refinement of a disparity map by the images' counts (match/refine.h). Thread rule: externally synchronised.
#pragma once

#include <cstddef>
#include <vector>

#include "match/matcher.h"

namespace simsense::cpu {

class Refinement {
 public:
  /// Refines the disparities `filtered` (after the median) to `refined`, both [height][width] and readable one vector beyond. The result
  /// does not depend on the number of workers.
  void apply(const MatchParameters& parameters, ConstImage left, ConstImage right, size_t width, size_t height, const float* filtered,
             float* refined, ks::ThreadPool& workers);

 private:
  std::vector<float> cells_;                    // [rows][columns][REFINE_CELL_FIGURES]
  std::vector<float> cell_steps_, cell_pulls_;  // [rows][columns], px
};

}  // namespace simsense::cpu
