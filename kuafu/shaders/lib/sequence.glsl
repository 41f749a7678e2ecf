// SPDX-License-Identifier: Apache-2.0
// Counter-based samples: 2-D Sobol points, Owen-scrambled per pixel and padded per dimension pair (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020).
#ifndef KUAFU_SEQUENCE_GLSL
#define KUAFU_SEQUENCE_GLSL

// Low-bias 32-bit integer hash (Wellons, "Prospecting for hash functions", lowbias32).
uint hash(uint x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  return x ^ (x >> 16);
}

// Laine-Karras permutation with Vegdahl's constants: each bit is flipped by a hash of the bits below it.
uint scramble_reversed(uint x, uint seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  return x ^ (x * 0x53a22864u);
}

// Second Sobol dimension with its bits reversed: the Pascal matrix modulo 2 as five butterfly steps.
uint sobol_1_reversed(uint i) {
  i ^= (i >> 1) & 0x55555555u;
  i ^= (i >> 2) & 0x33333333u;
  i ^= (i >> 4) & 0x0f0f0f0fu;
  i ^= (i >> 8) & 0x00ff00ffu;
  return i ^ (i >> 16);
}

// [0, 1)
float unit_float(uint x) { return float(x >> 8) * (1.0f / 16777216.0f); }

/// Point `index` of the pixel's sequence in dimension pair `pair`.
vec2 sample_2d(uint pixel_key, uint index, uint pair) {
  uint seed = hash(pixel_key + pair * 0x9e3779b9u);
  uint i = bitfieldReverse(scramble_reversed(bitfieldReverse(index), seed));
  uint x = bitfieldReverse(scramble_reversed(i, hash(seed ^ 0x68bc21ebu)));
  uint y = bitfieldReverse(scramble_reversed(sobol_1_reversed(i), hash(seed ^ 0x02e5be93u)));
  return vec2(unit_float(x), unit_float(y));
}

// Dimension pairs of a path.
const uint pair_pixel = 0u;
uint pair_direction(uint bounce) { return 1u + 3u * bounce; }
uint pair_choice(uint bounce) { return 2u + 3u * bounce; }  // x: lobe, y: Russian roulette
uint pair_light(uint bounce) { return 3u + 3u * bounce; }
const uint pair_lens = 0x8000u;  // of the camera; beyond the pairs of all bounces
const uint pair_time = 0x8001u;  // x: moment of the exposure
/// Where a medium scatters, and whether the path goes on from there; beyond the points on lights.
uint pair_flight(uint bounce) { return 0x40000u + 2u * bounce; }
uint pair_fog_or_surface(uint bounce) { return 0x40001u + 2u * bounce; }
/// Which of the beams that land there is asked for the k-th light.
uint pair_splat(uint bounce, uint k) { return 0x80000u + 0x100u * bounce + k; }
/// The point on the k-th light that a vertex asks; beyond all other pairs.
uint pair_light_point(uint bounce, uint k) { return 0x10000u + 0x100u * bounce + k; }
#endif
