// SPDX-License-Identifier: Apache-2.0
// The checks after the matcher on the host. A check that rejects a pixel sets its disparity to `invalid` and its confidence to 0, and says
// why. No result depends on the number of workers. Thread rule: a class is externally synchronised; a function is pure.
#pragma once

#include <vector>

#include "checks/checks.h"
#include "match/matcher.h"
#include "rectify/rectification.h"

namespace simsense {

/// Rejects pixels whose position in the source image lies outside of it, since they were matched in padding. Their reason: not_computed.
void invalidate_outside(const RemapTable& table, const MatchMaps& maps, float invalid, ks::ThreadPool& workers);

/// Rejects measurements in blank parts of the left image.
class TextureCheck {
 public:
  /// Rejects each valid pixel within drop_reach columns and rows of a blank square's middle, with the reason low_texture. At the border the
  /// square is cut to the image.
  void apply(const TextureParameters& parameters, ConstImage left, uint32_t width, uint32_t height, const MatchMaps& maps, float invalid,
             ks::ThreadPool& workers);

 private:
  std::vector<uint8_t> blank_;  // [height][width]
};

/// Rejects islands of disparity too small to be a surface. An island is a set of valid pixels joined by edges between neighbours
/// (4-connected) that differ by at most max_diff_px; it goes if it has at most max_size pixels (what OpenCV's filterSpeckles does).
class SpeckleFilter {
 public:
  /// The reason of rejected pixels: speckle. maps: packed [height][width]. Pixels at `invalid` belong to no island.
  void apply(const MatchMaps& maps, uint32_t width, uint32_t height, float invalid, uint32_t max_size, float max_diff_px,
             ks::ThreadPool& workers);

 private:
  uint32_t root(uint32_t pixel);
  void join(uint32_t a, uint32_t b);

  std::vector<uint32_t> parent_;  // union-find: towards the first pixel of the island in raster order
  std::vector<uint32_t> size_;    // at roots
};

/// Rejects measurements beside a step of disparity and matches at the right image's edges.
class EdgeCheck {
 public:
  /// Rejects a valid pixel if one of the eight neighbours is valid and further away by more than step_px (reason not_unique), or if the
  /// match lies within border_px of the right image's left or right edge (reason outside).
  void apply(const EdgeParameters& parameters, const MatchMaps& maps, uint32_t width, uint32_t height, float invalid,
             ks::ThreadPool& workers);

 private:
  std::vector<float> before_;  // [height][width]
};

/// Fills invalid disparities of each row inside the region with guesses, not measurements: off by default. disparity: packed rows of
/// `width`; a row of the region without valid pixels stays as it is.
void fill_holes(HoleFilling filling, float* disparity, uint32_t width, const Region& region, float invalid, ks::ThreadPool& workers);

/// Replaces reasons by the left image's own (saturated, low_texture) where those explain them (MAY_BE_EXPLAINED). reason: packed
/// [height][width].
void find_reasons(const ReasonParameters& parameters, ConstImage left, uint32_t width, uint32_t height, MatchReason* reason,
                  ks::ThreadPool& workers);

}  // namespace simsense
