// SPDX-License-Identifier: Apache-2.0
// Rejects matches in parts of the rectified image that lie outside its source. Thread rule: pure function; the result does not depend on
// the number of workers.
#pragma once

#include "match/matcher.h"
#include "rectify/rectification.h"

namespace simsense {

/// Rejects pixels whose position in the source image lies outside of it, since they were matched in padding: sets their disparity to
/// `invalid`, their reason to not_computed and their confidence to 0.
void invalidate_outside(const RemapTable& table, const MatchMaps& maps, float invalid, ks::ThreadPool& workers);

}  // namespace simsense
