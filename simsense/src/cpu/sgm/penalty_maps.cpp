// SPDX-License-Identifier: Apache-2.0
#include "cpu/sgm/penalty_maps.h"

#include <algorithm>
#include <cstdlib>

namespace simsense::cpu {

PenaltyMaps::PenaltyMaps(size_t width, size_t height, const MatchParameters& p)
    : width_(width),
      height_(height),
      directions_(p.p2_full_gradient_dn == 0 ? 0 : (p.path_count == 8 ? 4 : 2)),
      pitch_(round_up(width, 64) + 3 * margin),
      storage_(directions_ * (height + 1) * pitch_) {
  const uint32_t full = p.p2_full_gradient_dn;
  uint32_t penalty = p.p2;
  for (uint32_t gradient = 0; penalty > p.p1 && gradient < 65536 && directions_ > 0; ++gradient) {
    penalty = gradient <= full ? p.p2 : std::max(p.p1, p.p2 * full / gradient);
    of_gradient_.push_back(static_cast<uint8_t>(penalty));
  }
}

template <class T>
void PenaltyMaps::compute_row(const PaddedImage& image, size_t y) {
  constexpr ptrdiff_t steps[4][2] = {{-1, 0}, {0, -1}, {-1, -1}, {1, -1}};
  const uint8_t* table = of_gradient_.data();
  const auto last = static_cast<uint32_t>(of_gradient_.size() - 1);
  const T* here = image.at<T>(0, static_cast<ptrdiff_t>(y));
  for (size_t direction = 0; direction < directions_; ++direction) {
    const T* before = here + steps[direction][1] * image.pitch() + steps[direction][0];
    uint8_t* penalties = storage_.data() + (direction * (height_ + 1) + y) * pitch_ + margin;
    for (size_t x = 0; x <= width_; ++x) {
      const auto gradient = static_cast<uint32_t>(std::abs(static_cast<int>(here[x]) - static_cast<int>(before[x])));
      penalties[x] = table[std::min(gradient, last)];
    }
  }
}

void PenaltyMaps::compute_rows(const PaddedImage& image, size_t first_row, size_t end_row) {
  for (size_t y = first_row; y < end_row; ++y) {
    if (image.element_bytes() == 1) {
      compute_row<uint8_t>(image, y);
    } else {
      compute_row<uint16_t>(image, y);
    }
  }
}

}  // namespace simsense::cpu
