// SPDX-License-Identifier: Apache-2.0
// Full wells that overflow into their column (Janesick, Photon Transfer, 2007, on blooming). Thread rule: the result does not depend on the
// number of workers.
#pragma once

#include <cstddef>

#include "device/thread_pool.h"

namespace simsense::cpu {

/// Lets charge above full_well_e overflow. `share` of it, half down the column and half up, fills the next pixels with room, downward flow
/// first. The other share, and charge at the image's border, is drained. charge_e: [height][pitch].
void bloom(float* charge_e, size_t width, size_t height, size_t pitch, float full_well_e, float share, ks::ThreadPool& workers);

}  // namespace simsense::cpu
