// SPDX-License-Identifier: Apache-2.0
// The check that both images show more than noise (match/detection.h), slow and plain.
#pragma once

#include "match/matcher.h"
#include "simsense/reference/volume.h"

namespace simsense::reference {

/// Whether each pixel's disparity stays; p.invalid_disparity() = none, of which nothing is asked.
Grid<uint8_t> detects(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p,
                      const DetectionNoise& noise);

}  // namespace simsense::reference
