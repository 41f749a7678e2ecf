// SPDX-License-Identifier: Apache-2.0
// Census words. Plain (Zabih and Woodfill 1994, "Non-parametric local transforms for computing visual correspondence"): each pixel of the
// window is compared with the centre. Center-symmetric (Spangenberg et al. 2013, "Weighted semi-global matching and center-symmetric census
// transform"): each pixel of the window is compared with its mirror through the centre, which makes half the bits of the plain census carry
// the same structure. The threshold on the difference is that of center-symmetric local binary patterns (Heikkilä, Pietikäinen and Schmid
// 2009, "Description of interest regions with local binary patterns"), here a share of the local contrast.
#pragma once

#include "match/matcher.h"
#include "simsense/reference/volume.h"

namespace simsense::reference {

/// Center-symmetric: one bit per mirrored pair, (census_width * census_height - 1) / 2 of them: 1 where the pixel that comes first in
/// raster order is >= its mirror. Plain: one bit per pixel but the centre, in raster order: 1 where it is < the centre. Pixels outside the
/// image are 0.
/// census_contrast_256ths > 0: pixels outside the image are the nearest one inside. A bit needs a difference of more than
/// census_contrast_256ths / 256 of the range of counts in the window and contrast_margin around it, and of more than census_noise_dn
/// counts, so that noise between dots and on dark surfaces sets none. Plain: 1 where the pixel is that much below the centre.
/// Center-symmetric: 1 where the first pixel is that much above its mirror in the even pairs, and where the mirror is above the first in
/// the odd ones: with one direction alone a lone dot would be seen in half of the window.
Grid<uint64_t> census(ConstImage image, size_t width, size_t height, const MatchParameters& parameters);

}  // namespace simsense::reference
