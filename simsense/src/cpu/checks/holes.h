// SPDX-License-Identifier: Apache-2.0
// Hole filling along rows. Filled values are guesses, not measurements: off by default. Thread rule: pure function; the result does not
// depend on the number of workers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "match/choices.h"
#include "match/region.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Fills invalid disparities of each row inside the region. disparity: packed rows of `width`; a row of the region without valid pixels
/// stays as it is.
void fill_holes(HoleFilling filling, float* disparity, uint32_t width, const Region& region, float invalid, ks::ThreadPool& workers);

}  // namespace simsense
