// SPDX-License-Identifier: Apache-2.0
// Semi-global aggregation (Hirschmüller 2008, "Stereo processing by semiglobal matching and mutual information", eq. 13).
#pragma once

#include "match/matcher.h"
#include "simsense/reference/volume.h"

namespace simsense::reference {

/// The penalty of a disparity jump between two neighbouring pixels: p2, or less across an edge of the image (the same paper: P2 falls with
/// the gradient, and never below P1): p2 * full_gradient / gradient where the grey levels differ by more than full_gradient.
struct JumpPenalty {
  uint32_t p1 = 0, p2 = 0;
  uint32_t full_gradient = 0;  // 0: p2 everywhere, and no image is needed
  ConstImage image{};
  [[nodiscard]] uint32_t between(ptrdiff_t x, ptrdiff_t y, ptrdiff_t other_x, ptrdiff_t other_y) const;
};

/// L_r(p, d) = C(p, d) + min(L_r(p-r, d), L_r(p-r, d-1) + p1, L_r(p-r, d+1) + p1, min_k L_r(p-r, k) + p2) - min_k L_r(p-r, k),
/// for r = right, left, down, up, and of 8 the diagonals too; L_r = C where the path enters the image. The penalties count `block_area`
/// times. Returns the sum over the paths divided by their number, rounded down.
Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, const JumpPenalty& penalty, uint32_t block_area, uint32_t path_count);
/// Four paths with the same penalties everywhere.
Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, uint32_t p1, uint32_t p2);

}  // namespace simsense::reference
