// SPDX-License-Identifier: Apache-2.0
// What the matcher found where the rectified image shows nothing of its source.
// Thread rule: pure function; the result does not depend on the number of workers.
#pragma once

#include "match/matcher.h"
#include "rectify/rectification.h"

namespace simsense {

/// Disparity `invalid` (and reason not_computed, confidence 0) where a rectified pixel's position is not inside its source image: what was
/// matched there is padding.
void invalidate_outside(const RemapTable& table, const MatchMaps& maps, float invalid, ks::ThreadPool& workers);

}  // namespace simsense
