// SPDX-License-Identifier: Apache-2.0
// Census words of both images of each pair. Center-symmetric (Spangenberg et al. 2013): bit i tells whether the i-th pixel of the window in
// raster order is >= its mirror. Plain (Zabih and Woodfill 1994): whether it is < the centre. With a contrast: whether it differs by more than that
// share of the range of counts around (reference/census.h).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/match_constants.glsl"
#include "shared/match_push.h"

const uint tile_width = 64u, row_threads = 4u, thread_rows = 4u, tile_height = row_threads * thread_rows;
layout(local_size_x = tile_width, local_size_y = row_threads) in;
layout(constant_id = 0) const uint copies = 4u;  // of the right words, each one column further right
layout(constant_id = 1) const uint kind = CENSUS_CENTER_SYMMETRIC;
layout(constant_id = 2) const uint census_words = 1u;  // 2 where a plain window has more than 32 bits
layout(constant_id = 3) const uint element_bytes = 1u;  // of the images
layout(constant_id = 4) const uint keep_gray = 0u;
layout(constant_id = 5) const uint contrast = 0u;  // 256ths
layout(push_constant, scalar) uniform Push { CensusPush push; };

const uint margin = contrast > 0u ? 2u : 0u;  // how far beyond the window the range is taken
const uint range_width = census_width + 2u * margin, range_height = census_height + 2u * margin;
const uint shared_width = tile_width + range_width - 1u, shared_height = tile_height + range_height - 1u;
const uint extreme_count = contrast > 0u ? shared_width * tile_height : 1u;
const uint invocations = tile_width * row_threads;
shared uint pixels[shared_width * shared_height];
shared uint extremes[extreme_count];  // of a column over the range's height: lowest count, highest << 16
const uint fixed_tolerance = kind == CENSUS_PLAIN ? 0u : 0xffffffffu;  // without contrast; -1: equal counts set the bit, too
const uint tolerance_pitch = tile_width + 1u;
shared uint tolerances[contrast > 0u ? tolerance_pitch * tile_height : 1u];

uint pixel(bool right, int x, int y) {
  ivec2 inside = clamp(ivec2(x, y), ivec2(0), ivec2(push.width, push.height) - 1);
  if (contrast == 0u && inside != ivec2(x, y)) return 0u;
  uint element = (gl_WorkGroupID.z >> 1) * push.image_stride + uint(inside.y) * push.image_pitch + uint(inside.x);
  uint byte = (right ? push.right_byte : push.left_byte) + element * element_bytes;
  uint word = right ? push.right_image.at[byte >> 2] : push.left_image.at[byte >> 2];
  return word >> (8u * (byte & 3u)) & (element_bytes == 1u ? 0xffu : 0xffffu);
}

void load_tile(bool right, ivec2 origin) {
  for (uint i = gl_LocalInvocationIndex; i < shared_width * shared_height; i += invocations) {
    ivec2 at = origin + ivec2(i % shared_width, i / shared_width) - ivec2(census_width / 2u + margin, census_height / 2u + margin);
    pixels[i] = pixel(right, at.x, at.y);
  }
}

/// Of one column and thread_rows rows, whose windows share all lines but the outermost.
void find_column_extremes(uint column, uint first_row) {
  uint first = first_row * shared_width + column, low = 0xffffu, high = 0u;
  for (uint k = thread_rows - 1u; k < range_height; ++k) {
    uint count = pixels[first + k * shared_width];
    low = min(low, count);
    high = max(high, count);
  }
  [[unroll]] for (uint row = 0u; row < thread_rows; ++row) {
    uint least = low, most = high;
    [[unroll]] for (uint k = 0u; k < thread_rows - 1u; ++k) {
      uint count = pixels[first + (k < row ? range_height + k : k) * shared_width];
      least = min(least, count);
      most = max(most, count);
    }
    extremes[first + row * shared_width] = least | most << 16;
  }
}

/// The largest differences that count as none, of four neighbouring columns at a time, as above. Neighbouring invocations take neighbouring
/// rows, which lie in different banks of shared memory.
void find_tolerances(uint column, uint row) {
  uint first = row * shared_width + column, low = 0xffffu, high = 0u;
  for (uint k = 3u; k < range_width; ++k) {
    uint extreme = extremes[first + k];
    low = min(low, extreme & 0xffffu);
    high = max(high, extreme >> 16);
  }
  [[unroll]] for (uint x = 0u; x < 4u; ++x) {
    uint least = low, most = high;
    [[unroll]] for (uint k = 0u; k < 3u; ++k) {
      uint extreme = extremes[first + (k < x ? range_width + k : k)];
      least = min(least, extreme & 0xffffu);
      most = max(most, extreme >> 16);
    }
    tolerances[row * tolerance_pitch + column + x] = max(contrast * (most - least) >> 8, census_noise_dn);
  }
}

/// Appends the bit that tells whether `brighter` is above `darker` by more than the tolerance: the sign of the opposite.
void append_bit(inout uint bits, uint brighter, uint darker, uint tolerance) { bits = bits << 1 | (darker + tolerance - brighter) >> 31; }

/// The highest bit first.
uvec2 center_symmetric_word(uint first, uint tolerance) {
  const uint cells = census_width * census_height;
  uint last = first + (census_height - 1u) * shared_width + census_width - 1u, bits = 0u;
  [[unroll]] for (uint n = 0u; n < cells / 2u; ++n) {
    uint i = cells / 2u - 1u - n, offset = i / census_width * shared_width + i % census_width;
    uint pixel = pixels[first + offset], mirror = pixels[last - offset];
    bool first_turn = contrast == 0u || (i & 1u) == 0u;  // where equal counts are no difference, the pixel and its mirror take turns
    append_bit(bits, first_turn ? pixel : mirror, first_turn ? mirror : pixel, tolerance);
  }
  return uvec2(bits, 0u);
}

uvec2 plain_word(uint first, uint tolerance) {
  const uint cells = census_width * census_height;
  uint centre = pixels[first + census_height / 2u * shared_width + census_width / 2u];
  uvec2 bits = uvec2(0u);
  [[unroll]] for (uint n = 0u; n < cells; ++n) {
    uint i = cells - 1u - n;
    if (i == cells / 2u) continue;
    uint bit = i < cells / 2u ? i : i - 1u;
    append_bit(bits[bit / 32u], centre, pixels[first + i / census_width * shared_width + i % census_width], tolerance);
  }
  return bits;
}

void store_words(UintArray to, uint at, uvec2 words) {
  to.at[at * census_words] = words.x;
  if (census_words == 2u) to.at[at * census_words + 1u] = words.y;
}

void store_left(uint row, uint x, uvec2 words, uint count) {
  uint at = row * push.width + x;
  store_words(push.left_census, at + left_margin, words);
  if (keep_gray != 0u) push.gray.at[at + left_margin] = count;
  push.right_winner.at[at] = 0xffffffffu;
}

void store_right(uint row, int x, uvec2 words) {
  uint at = uint(int(row * push.right_pitch + push.right_origin) + x);
  for (uint copy = 0u; copy < copies; ++copy) store_words(push.right_census, copy * push.right_copy_words + at + copy, words);
}

void main() {
  bool right = (gl_WorkGroupID.z & 1u) != 0u;
  uint outside_tiles = (push.right_origin + tile_width - 1u) / tile_width;
  int tile_x = (int(gl_WorkGroupID.x) - int(outside_tiles)) * int(tile_width), tile_y = int(gl_WorkGroupID.y * tile_height);
  if (tile_x < 0 && !right) return;
  int shift = right ? push.min_disparity : 0, last_x = int(push.width) - 1, source_x = clamp(tile_x - shift, 0, last_x);
  load_tile(right, ivec2(source_x, tile_y));
  barrier();
  if (contrast > 0u) {
    for (uint i = gl_LocalInvocationIndex; i < shared_width * row_threads; i += invocations)
      find_column_extremes(i % shared_width, i / shared_width * thread_rows);
    barrier();
    find_tolerances(gl_LocalInvocationIndex / tile_height * 4u, gl_LocalInvocationIndex % tile_height);
    barrier();
  }
  int x = tile_x + int(gl_LocalInvocationID.x);
  if (x < -int(push.right_origin) || x > last_x) return;
  uint column = uint(clamp(x - shift, 0, last_x) - source_x);
  [[unroll]] for (uint i = 0u; i < thread_rows; ++i) {
    uint local_y = gl_LocalInvocationID.y * thread_rows + i, y = uint(tile_y) + local_y;
    if (y >= push.height) return;
    uint first = (local_y + margin) * shared_width + column + margin;
    uint tolerance = contrast > 0u ? tolerances[local_y * tolerance_pitch + column] : fixed_tolerance;
    uvec2 words = kind == CENSUS_PLAIN ? plain_word(first, tolerance) : center_symmetric_word(first, tolerance);
    uint row = (gl_WorkGroupID.z >> 1) * push.height + y;
    if (right) {
      store_right(row, x, words);
    } else {
      store_left(row, uint(x), words, pixels[first + census_height / 2u * shared_width + census_width / 2u]);
    }
  }
}
