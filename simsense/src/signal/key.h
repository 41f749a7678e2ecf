// SPDX-License-Identifier: Apache-2.0
// Where randomness comes from: each pixel has one uniform 32-bit word per dimension, a pure function of the dimension's key and the pixel.
// Four neighbours in a row share a Philox block. Thread rule: pure functions.
#pragma once

#include <array>
#include <cstdint>

#include "shared/dimensions.h"

namespace simsense {

// Philox4x32-10, a counter-based random generator (Salmon, Moraes, Dror, Shaw: Parallel random numbers: as easy as 1, 2, 3. SC 2011). A
// block is a pure function of counter and key, so any pixel can be drawn by any thread in any order.
using PhiloxBlock = std::array<uint32_t, 4>;
using PhiloxKey = std::array<uint32_t, 2>;

struct PhiloxConstants {
  static constexpr uint32_t multiplier0 = 0xD2511F53u, multiplier1 = 0xCD9E8D57u;
  static constexpr uint32_t weyl0 = 0x9E3779B9u, weyl1 = 0xBB67AE85u;
  static constexpr int rounds = 10;
};

inline PhiloxBlock philox(PhiloxBlock counter, PhiloxKey key) {
  using C = PhiloxConstants;
  for (int round = 0; round < C::rounds; ++round) {
    const uint64_t product0 = uint64_t{C::multiplier0} * counter[0], product1 = uint64_t{C::multiplier1} * counter[2];
    counter = {static_cast<uint32_t>(product1 >> 32) ^ counter[1] ^ key[0], static_cast<uint32_t>(product1),
               static_cast<uint32_t>(product0 >> 32) ^ counter[3] ^ key[1], static_cast<uint32_t>(product0)};
    key[0] += C::weyl0;
    key[1] += C::weyl1;
  }
  return counter;
}

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
