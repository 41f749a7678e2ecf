// SPDX-License-Identifier: Apache-2.0
// What follows from the winners: left-right check and median.
#pragma once

#include "match/matcher.h"
#include "simsense/reference/volume.h"

namespace simsense::reference {

/// -1 where the left disparity, rounded, points outside the right image or differs by more than max_diff from the right disparity there.
/// reason: if given, outside and occluded are noted.
Grid<float> left_right_check(const Grid<float>& left, const Grid<uint32_t>& right, int32_t max_diff, int32_t min_disparity = 0,
                             Grid<MatchReason>* reason = nullptr);

/// Median of size x size values, invalid ones (-1) included; pixels nearer than size / 2 to the border are copied.
Grid<float> median(const Grid<float>& disparity, size_t size);

}  // namespace simsense::reference
