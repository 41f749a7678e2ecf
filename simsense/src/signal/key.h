// SPDX-License-Identifier: Apache-2.0
// Where randomness comes from: each pixel has one uniform 32-bit word per dimension, a pure function of the dimension's key and the pixel.
// Four neighbours in a row share a Philox block. Thread rule: pure functions.
#pragma once

#include <cstdint>

#include "shared/dimensions.h"
#include "signal/philox.h"

namespace simsense {

/// The key of one image's noise. Equal keys give equal noise; any difference gives an independent stream.
struct NoiseKey {
  uint64_t seed = 0, frame_index = 0, scene_index = 0;
  uint32_t view = 0, side = 0;  // side: 0 left, 1 right
};

/// The uses of random numbers; each has a number of its own.
enum class Dimension : uint32_t {
  speckle_static = DIMENSION_SPECKLE_STATIC,
  speckle_temporal = DIMENSION_SPECKLE_TEMPORAL,
  prnu = DIMENSION_PRNU,
  hot_pixel = DIMENSION_HOT_PIXEL,
  shot = DIMENSION_SHOT,
  dsnu = DIMENSION_DSNU,
  row_fixed = DIMENSION_ROW_FIXED,
  column_fixed = DIMENSION_COLUMN_FIXED,
  row_temporal = DIMENSION_ROW_TEMPORAL,
  column_temporal = DIMENSION_COLUMN_TEMPORAL,
  read = DIMENSION_READ,
  adc = DIMENSION_ADC,
};

/// Encrypts (index, view, side) by the 64-bit seed, so that 161 bits of address fit a 64-bit Philox key.
inline PhiloxKey encrypted_key(const NoiseKey& k, uint64_t index) {
  const PhiloxBlock block = philox({static_cast<uint32_t>(index), static_cast<uint32_t>(index >> 32), k.view, k.side},
                                   {static_cast<uint32_t>(k.seed), static_cast<uint32_t>(k.seed >> 32)});
  return {block[0], block[1]};
}

/// The keys of a frame's noise: drawn anew in each frame, fixed to the scene, fixed to the sensor. Each dimension uses one of them only.
struct StreamKeys {
  PhiloxKey frame, scene, sensor;

  explicit StreamKeys(const NoiseKey& k)
      : frame(encrypted_key(k, k.frame_index)), scene(encrypted_key(k, k.scene_index)), sensor(encrypted_key(k, 0)) {}
};

/// The uniform random word of one pixel. Columns left of the image are negative numbers in two's complement.
inline uint32_t pixel_word(const PhiloxKey& key, Dimension dimension, uint32_t x, uint32_t y) {
  const auto block_x = static_cast<uint32_t>(static_cast<int32_t>(x) >> 2);
  return philox({block_x, y, static_cast<uint32_t>(dimension), 0}, key)[x & 3];
}

}  // namespace simsense
