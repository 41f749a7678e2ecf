// Hole filling along rows. What it writes is a guess, not a measurement: off by default.
// Thread rule: pure function; the result does not depend on the number of workers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "matcher.h"

namespace simsense {

enum class HoleFilling : uint8_t {
  none,
  left,        // the valid pixel to the left: what a left camera's occlusions border on
  background,  // the farther of the valid pixels to the left and right; either alone at the image's border (the interpolation of the KITTI
               // stereo benchmark's development kit: Geiger, Lenz, Urtasun, CVPR 2012)
};

/// A rectangle of pixels, [x0, x1) x [y0, y1).
struct Region {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  bool operator==(const Region&) const = default;
};

/// disparity: packed rows of `width`; a row of the region without valid pixels stays as it is.
void fill_holes(HoleFilling filling, float* disparity, uint32_t width, const Region& region, float invalid, ks::ThreadPool& workers);

}  // namespace simsense
