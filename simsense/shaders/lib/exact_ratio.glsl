// SPDX-License-Identifier: Apache-2.0
// A quotient rounded as IEEE 754 wants it: Vulkan's own division may be 2.5 units in the last place off, and the disparities shall have the
// same bits on every device.
#ifndef SIMSENSE_EXACT_RATIO_GLSL
#define SIMSENSE_EXACT_RATIO_GLSL

/// n / m to nearest even, for n < m < 2^30.
float exact_ratio(uint n, uint m) {
  if (n == 0u) return 0.0f;
  int exponent = 0;
  for (; n < m; n <<= 1) --exponent;
  uint quotient = 0u;  // 24 bits, the first is set
  for (uint i = 0u; i < 24u; ++i) {
    bool bit = n >= m;
    quotient = quotient << 1 | uint(bit);
    n = (bit ? n - m : n) << 1;
  }
  if (n > m || (n == m && (quotient & 1u) != 0u)) ++quotient;
  return float(quotient) * uintBitsToFloat(uint(exponent - 23 + 127) << 23);
}
#endif
