// Causes behind an invalid pixel: of what the stages rejected, whatever the left image itself explains is put down to the image.
// Thread rule: pure function; the result does not depend on the number of workers.
#pragma once

#include "disparity/holes.h"
#include "matcher.h"

namespace simsense {

struct ReasonParameters {
  uint32_t window_width = 7, window_height = 7;  // that of the census
  uint32_t low_texture_dn = 0;                   // a window whose grey levels span no more than this has too little texture
  uint32_t saturated_dn = 255;                   // the imager's largest count; at least half of the window must have it
};

/// reason: packed [height][width]. Only reasons of the stages (not_unique, occluded, isolated, speckle, out_of_range) change.
void explain_invalid(const ReasonParameters& parameters, ConstImage left, uint32_t width, uint32_t height, MatchReason* reason,
                     ks::ThreadPool& workers);

}  // namespace simsense
