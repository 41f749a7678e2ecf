// SPDX-License-Identifier: Apache-2.0
// Counts of an image as the refinement reads them (match/refine.h).
#ifndef SIMSENSE_COUNTS_GLSL
#define SIMSENSE_COUNTS_GLSL
#include "shared/match_push.h"

layout(constant_id = 0) const uint element_bytes = 1u;  // of the images

const uint extra_bits = element_bytes == 1u ? 0u : 4u;

/// element: after that of the first byte. Counts have so many bits.
int count_at(UintArray image, uint first_byte, uint bits, uint element) {
  uint byte = first_byte + element * element_bytes, word = image.at[byte >> 2] >> (8u * (byte & 3u));
  if (element_bytes == 1u) return int(word & 0xffu);
  uint count = word & 0xffffu;
  return int(min(bits < 12u ? count << (12u - bits) : count >> (bits - 12u), 4095u));
}
#endif
