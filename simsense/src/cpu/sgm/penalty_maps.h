// SPDX-License-Identifier: Apache-2.0
// The jump penalty between neighbouring pixels, where it depends on the image's gradient (reference/sgm.h, JumpPenalty).
#pragma once

#include <vector>

#include "cpu/census/census.h"

namespace simsense::cpu {

/// The neighbour that a path comes from. A path of the opposite direction reads the neighbour's penalty.
enum PathDirection : size_t { from_left, from_above, from_above_left, from_above_right };

class PenaltyMaps {
 public:
  PenaltyMaps(size_t width, size_t height, const MatchParameters& parameters);
  /// Whether all pixels have one penalty, so that there are no maps.
  [[nodiscard]] bool uniform() const { return directions_ == 0; }
  void compute_rows(const PaddedImage& image, size_t first_row, size_t end_row);
  /// Penalties of row y, which may be the row below the last; columns -64 to width + 64 are readable.
  [[nodiscard]] const uint8_t* row(PathDirection direction, size_t y) const {
    return storage_.data() + (direction * (height_ + 1) + y) * pitch_ + margin;
  }

 private:
  static constexpr size_t margin = 64;
  template <class T>
  void compute_row(const PaddedImage& image, size_t y);

  size_t width_, height_, directions_, pitch_;
  std::vector<uint8_t> of_gradient_;  // steeper ones have the last entry
  Buffer<uint8_t> storage_;
};

}  // namespace simsense::cpu
