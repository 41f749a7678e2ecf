// SPDX-License-Identifier: Apache-2.0
// Speckle filter: islands of disparity too small to be a surface. An island is a set of valid pixels joined by edges between neighbours
// (4-connected) that differ by at most max_diff_px; it goes if it has at most max_size pixels (what OpenCV's filterSpeckles does).
// Thread rule: externally synchronised (it owns its labels); the result does not depend on the number of workers.
#pragma once

#include <cstdint>
#include <vector>

#include "match/matcher.h"

namespace simsense {

class SpeckleFilter {
 public:
  /// Rejects islands of at most max_size pixels, whose neighbours differ by at most max_diff_px: sets their disparity to `invalid`, their
  /// reason to speckle and their confidence to 0. maps: packed [height][width]. Pixels at `invalid` belong to no island.
  void apply(const MatchMaps& maps, uint32_t width, uint32_t height, float invalid, uint32_t max_size, float max_diff_px,
             ks::ThreadPool& workers);

 private:
  uint32_t root(uint32_t pixel);
  void join(uint32_t a, uint32_t b);

  std::vector<uint32_t> parent_;  // union-find: towards the first pixel of the island in raster order
  std::vector<uint32_t> size_;    // at roots
};

}  // namespace simsense
