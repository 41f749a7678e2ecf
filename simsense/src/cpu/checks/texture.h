// SPDX-License-Identifier: Apache-2.0
// Rejects measurements where the left image shows only its own noise. Thread rule: externally synchronised.
#pragma once

#include <vector>

#include "checks/texture.h"
#include "match/matcher.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Rejects measurements in blank parts of the left image. The result does not depend on the number of workers.
class TextureCheck {
 public:
  /// Rejects each valid pixel within drop_reach columns and rows of a blank square's middle: sets its disparity to `invalid`, its reason to
  /// low_texture and its confidence to 0. At the border the square is cut to the image.
  void apply(const TextureParameters& parameters, ConstImage left, uint32_t width, uint32_t height, const MatchMaps& maps, float invalid,
             ks::ThreadPool& workers);

 private:
  std::vector<uint8_t> blank_;  // [height][width]
};

}  // namespace simsense
