// SPDX-License-Identifier: Apache-2.0
// One element of an image whose format need not be 32 bits wide.
#ifndef KUAFU_ELEMENT_GLSL
#define KUAFU_ELEMENT_GLSL
#include "shared/wave.h"

const float most_half = 65504.0f;

/// NaN has no integer: it becomes 0.
uint rounded(float value, float most) { return isnan(value) ? 0u : uint(clamp(value, 0.0f, most) + 0.5f); }

uint element_of_float(float value, uint format) {
  if (format == format_u8) return rounded(value, 255.0f);
  if (format == format_u16) return rounded(value, 65535.0f);
  if (format == format_f16) return packHalf2x16(vec2(isnan(value) ? value : clamp(value, -most_half, most_half), 0.0f)) & 0xffffu;
  return floatBitsToUint(value);
}

/// Writes the low bits of `value`; neighbours in the same word may be written at the same time.
void store_element(UintArray words, uint element, uint format, uint value) {
  uint bits = format_bits(format);
  if (bits == 32u) {
    words.at[element] = value;
    return;
  }
#ifdef __cplusplus
  if (bits == 8u) reinterpret_cast<uint8_t*>(words.at)[element] = uint8_t(value);
  else reinterpret_cast<uint16_t*>(words.at)[element] = uint16_t(value);
#else
  uint in_word = 32u / bits, word = element / in_word, shift = element % in_word * bits, mask = (1u << bits) - 1u;
  atomicAnd(words.at[word], ~(mask << shift));
  atomicOr(words.at[word], (value & mask) << shift);
#endif
}
#endif
