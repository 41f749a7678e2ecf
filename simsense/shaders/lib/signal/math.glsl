// SPDX-License-Identifier: Apache-2.0
// Elementary functions and quantiles for four pixels at once: the formulas of cpu/signal/math-inl.h, to the device's rounding.
#ifndef SIMSENSE_SIGNAL_MATH_GLSL
#define SIMSENSE_SIGNAL_MATH_GLSL
#extension GL_EXT_control_flow_attributes : require

/// ln x of positive normal numbers: 2 artanh((m - 1) / (m + 1)) of the mantissa m in [sqrt(1/2), sqrt(2)). Vulkan's own log is only good to
/// 2^-21 absolute between 0.5 and 2.
vec4 natural_log(vec4 x) {
  ivec4 bits = floatBitsToInt(x), exponent = (bits - 0x3F3504F3) >> 23;
  vec4 m = intBitsToFloat(bits - (exponent << 23));
  vec4 s = (m - 1.0f) / (m + 1.0f), s2 = s * s;
  vec4 series = (((2.0f / 9.0f * s2 + 2.0f / 7.0f) * s2 + 2.0f / 5.0f) * s2 + 2.0f / 3.0f) * s2 + 2.0f;
  return vec4(exponent) * 0.693147181f + s * series;
}

/// e^x, x clamped to -87..88: 2^n times the Taylor series of what is left of x.
vec4 exponential(vec4 x) {
  x = clamp(x, -87.0f, 88.0f);
  vec4 whole = roundEven(x * 1.44269504f);
  precise vec4 rest = (x - whole * 0.693359375f) - whole * -2.12194440e-4f;  // ln 2 in two parts
  vec4 series = 1.0f / 5040.0f * rest + 1.0f / 720.0f;
  series = ((((series * rest + 1.0f / 120.0f) * rest + 1.0f / 24.0f) * rest + 1.0f / 6.0f) * rest + 0.5f) * rest * rest + rest + 1.0f;
  return series * intBitsToFloat((ivec4(whole) + 127) << 23);
}

/// The uniform number (word + 1/2) / 2^32 by its distances from 1/2 and from the nearer end, each to full precision.
struct Uniform {
  bvec4 low;          // below 1/2
  vec4 centre, tail;  // > 0; their sum is 1/2
};

vec4 scaled_word(ivec4 n) { return (vec4(n) + 0.5f) * 2.3283064365386963e-10f; }

Uniform uniform_of(uvec4 words) {
  ivec4 centred = ivec4(words ^ 0x80000000u), distance = centred ^ (centred >> 31);
  return Uniform(lessThan(centred, ivec4(0)), scaled_word(distance), scaled_word(0x7FFFFFFF - distance));
}

/// The standard normal quantile: algorithm AS 241, PPND7 (Wichura, Applied Statistics 37(3), 1988).
vec4 normal_of(Uniform u) {
  vec4 r = 0.180625f - u.centre * u.centre;
  vec4 centre_top = u.centre * (((59.109374720f * r + 159.29113202f) * r + 50.434271938f) * r + 3.3871327179f);
  vec4 centre_bottom = ((67.187563600f * r + 78.757757664f) * r + 17.895169469f) * r + 1.0f;
  vec4 t = sqrt(-natural_log(u.tail)) - 1.6f;
  vec4 tail_top = ((0.17023821103f * t + 1.3067284816f) * t + 2.7568153900f) * t + 1.4234372777f;
  vec4 tail_bottom = (0.12021132975f * t + 0.73700164250f) * t + 1.0f;
  bvec4 is_centre = lessThanEqual(u.centre, vec4(0.425f));
  vec4 magnitude = mix(tail_top, centre_top, is_centre) / mix(tail_bottom, centre_bottom, is_centre);
  return mix(magnitude, -magnitude, u.low);
}

vec4 normals_of(uvec4 words) { return normal_of(uniform_of(words)); }
#endif
