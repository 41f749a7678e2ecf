// Census words. Plain (Zabih and Woodfill 1994, "Non-parametric local transforms for computing visual correspondence"): each pixel of the
// window is compared with the centre. Center-symmetric (Spangenberg et al. 2013, "Weighted semi-global matching and center-symmetric census
// transform"): each pixel of the window is compared with its mirror through the centre, which makes half the bits of the plain census carry
// the same structure.
#pragma once

#include "matcher.h"
#include "reference/volume.h"

namespace simsense::reference {

/// Center-symmetric: one bit per mirrored pair, (window_width * window_height - 1) / 2 of them: 1 where the pixel that comes first in
/// raster order is >= its mirror. Plain: one bit per pixel but the centre, in raster order: 1 where it is < the centre. Pixels outside the
/// image are 0.
Grid<uint64_t> census(ConstImage image, size_t width, size_t height, size_t window_width, size_t window_height,
                      CensusKind kind = CensusKind::center_symmetric);

}  // namespace simsense::reference
