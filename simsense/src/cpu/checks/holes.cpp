// SPDX-License-Identifier: Apache-2.0
#include "cpu/checks/checks.h"

#include <algorithm>

namespace simsense {
namespace {

void fill_row(HoleFilling filling, float* begin, float* end, float invalid) {
  for (float* hole = std::find(begin, end, invalid); hole != end; hole = std::find(hole, end, invalid)) {
    float* behind = std::find_if(hole, end, [invalid](float d) { return d != invalid; });
    const float left = hole == begin ? invalid : hole[-1], right = behind == end ? invalid : *behind;
    float guess = left;
    if (filling == HoleFilling::background && right != invalid) guess = left == invalid ? right : std::min(left, right);
    std::fill(hole, behind, guess);
    hole = behind;
  }
}

}  // namespace

void fill_holes(HoleFilling filling, float* disparity, uint32_t width, const Region& region, float invalid, ks::ThreadPool& workers) {
  if (filling == HoleFilling::keep) return;
  workers.parallel_for(region.y1 - region.y0, [&](size_t i) {
    float* row = disparity + (region.y0 + i) * width;
    fill_row(filling, row + region.x0, row + region.x1, invalid);
  });
}

}  // namespace simsense
