// SPDX-License-Identifier: Apache-2.0
// Disparity to depth on the host.
// Thread rule: pure function; the result does not depend on the number of workers.
#pragma once

#include "depth/depth.h"
#include "rectify/rectification.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Converts disparities to depth. disparity: packed [height][width], pixels; `invalid` and smaller values are invalid. depth: packed
/// [height][width], metres, 0 = invalid; may be the same memory.
void depth_from_disparity(const StereoGeometry& geometry, const DepthRange& range, const float* disparity, float invalid, uint32_t width,
                          uint32_t height, float* depth, ks::ThreadPool& workers);

}  // namespace simsense
