// SPDX-License-Identifier: Apache-2.0
// Quotients rounded as IEEE 754 wants them: Vulkan's own division may be 2.5 units in the last place off, and disparities, depth,
// points and what registration makes of them shall have the same bits on every device.
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

/// a / b to nearest even; by the device's own division where one of the three is 0, subnormal, infinite or no number.
float exact_quotient(float a, float b) {
  uint bits_a = floatBitsToUint(a), bits_b = floatBitsToUint(b), exponent_a = bits_a >> 23 & 255u, exponent_b = bits_b >> 23 & 255u;
  uint n = bits_a & 0x7fffffu | 0x800000u, m = (bits_b & 0x7fffffu | 0x800000u) << 1;  // 24 bits each, so that n < m
  uint ratio = floatBitsToUint(exact_ratio(n, m));
  int exponent = int(ratio >> 23) + int(exponent_a) - int(exponent_b) + 1;
  bool normal = exponent_a - 1u < 254u && exponent_b - 1u < 254u && exponent > 0 && exponent < 255;
  return normal ? uintBitsToFloat((bits_a ^ bits_b) & 0x80000000u | uint(exponent) << 23 | ratio & 0x7fffffu) : a / b;
}
#endif
