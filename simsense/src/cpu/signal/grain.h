// SPDX-License-Identifier: Apache-2.0
// The normal numbers of grains (signal/imager.h) on the host.
#pragma once

#include "cpu/simd/buffer.h"
#include "device/thread_pool.h"
#include "signal/key.h"

namespace simsense::cpu {

/// Returns standard normals [height][pitch] that neighbours share by a Gaussian PSF of sigma_px. pitch: a multiple of row_padding, at least
/// the width.
Buffer<float> grain_normals(const PhiloxKey& key, Dimension dimension, float sigma_px, size_t pitch, size_t height,
                            ks::ThreadPool& workers);

}  // namespace simsense::cpu
