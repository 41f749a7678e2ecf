// SPDX-License-Identifier: Apache-2.0
// The imager's stages on images in the host's memory, row by row; stages at neutral values are skipped.
// Thread rule: may run on several threads at once, and the result does not depend on the number of workers.
#pragma once

#include <cstddef>
#include <optional>

#include "cpu/simd/buffer.h"
#include "device/thread_pool.h"
#include "image/view.h"
#include "signal/imager.h"
#include "signal/key.h"

namespace simsense::cpu {

/// The light on one imager, [height][width], in KS_FORMAT_U8, U16 or F32.
struct Irradiance {
  ConstPlane all;
  std::optional<ConstPlane> laser;  // its part that has speckle; without one, all has
};

/// Converts light to counts, packed [height][width]: uint8_t, uint16_t if imager.is_wide(), or float, which is neither rounded nor clipped.
template <class Count>
void measure(const Imager& imager, const NoiseKey& key, const Irradiance& light, uint32_t width, uint32_t height, Count* counts,
             ks::ThreadPool& workers);

/// Lets charge above full_well_e overflow into its column (Janesick, Photon Transfer, 2007, on blooming). `share` of it, half down the
/// column and half up, fills the next pixels with room, downward flow first. The other share, and charge at the image's border, is drained.
/// charge_e: [height][pitch].
void bloom(float* charge_e, size_t width, size_t height, size_t pitch, float full_well_e, float share, ks::ThreadPool& workers);

/// Returns the normal numbers of grains (signal/imager.h), [height][pitch], that neighbours share by a Gaussian PSF of sigma_px. pitch: a
/// multiple of row_padding, at least the width.
Buffer<float> grain_normals(const PhiloxKey& key, Dimension dimension, float sigma_px, size_t pitch, size_t height,
                            ks::ThreadPool& workers);

}  // namespace simsense::cpu
