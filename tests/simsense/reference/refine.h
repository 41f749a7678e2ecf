// SPDX-License-Identifier: Apache-2.0
// The refinement of a disparity map by the images' counts (match/refine.h), slow and plain.
#pragma once

#include "match/matcher.h"
#include "simsense/reference/volume.h"

namespace simsense::reference {

/// disparity: after the median, with min_disparity added; p.invalid_disparity() = none, which stays so.
Grid<float> refine(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p);

}  // namespace simsense::reference
