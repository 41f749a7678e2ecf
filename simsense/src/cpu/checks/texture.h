// SPDX-License-Identifier: Apache-2.0
// What was measured where the left image shows nothing but its own noise.
// Thread rule: externally synchronised.
#pragma once

#include <vector>

#include "checks/texture.h"
#include "match/matcher.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// The result does not depend on the number of workers.
class TextureCheck {
 public:
  /// Disparity `invalid` (and reason low_texture, confidence 0) of each valid pixel up to drop_reach columns and rows away from one about
  /// which the square of window_reach, as far as it is in the image, is blank.
  void apply(const TextureParameters& parameters, ConstImage left, uint32_t width, uint32_t height, const MatchMaps& maps, float invalid,
             ks::ThreadPool& workers);

 private:
  std::vector<uint8_t> blank_;  // [height][width]
};

}  // namespace simsense
