// SPDX-License-Identifier: Apache-2.0
// The uniform words of four neighbours in a row (signal/key.h): one Philox4x32-10 block (Salmon, Moraes, Dror, Shaw, SC 2011).
#ifndef SIMSENSE_SIGNAL_RANDOM_GLSL
#define SIMSENSE_SIGNAL_RANDOM_GLSL

#include "shared/dimensions.h"

uvec4 philox(uvec4 counter, uvec2 key) {
  for (uint round = 0u; round < 10u; ++round) {
    uint high0, low0, high1, low1;
    umulExtended(0xD2511F53u, counter.x, high0, low0);
    umulExtended(0xCD9E8D57u, counter.z, high1, low1);
    counter = uvec4(high1 ^ counter.y ^ key.x, low1, high0 ^ counter.w ^ key.y, low0);
    key += uvec2(0x9E3779B9u, 0xBB67AE85u);
  }
  return counter;
}

/// Words of columns 4 * quad .. 4 * quad + 3; both coordinates may be negative, as two's complements.
uvec4 quad_words(uvec2 key, uint dimension, uint quad, uint y) { return philox(uvec4(quad, y, dimension, 0u), key); }
#endif
