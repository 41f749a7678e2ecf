// SPDX-License-Identifier: Apache-2.0
// The imager's stages on images in the host's memory, row by row; stages at neutral values are skipped.
// Thread rule: may run on several threads at once, and the result does not depend on the number of workers.
#pragma once

#include <optional>

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

}  // namespace simsense::cpu
