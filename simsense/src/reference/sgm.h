// Semi-global aggregation over four paths (Hirschmüller 2008, "Stereo processing by semiglobal matching and mutual information", eq. 13).
#pragma once

#include "reference/volume.h"

namespace simsense::reference {

/// L_r(p, d) = C(p, d) + min(L_r(p-r, d), L_r(p-r, d-1) + p1, L_r(p-r, d+1) + p1, min_k L_r(p-r, k) + p2) - min_k L_r(p-r, k),
/// for r = right, left, down, up; L_r = C where the path enters the image. Returns (sum of the four) / 4, rounded down.
Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, uint32_t p1, uint32_t p2);

}  // namespace simsense::reference
