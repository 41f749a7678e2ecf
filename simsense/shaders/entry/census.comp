// Census words of both images of each pair. Center-symmetric (Spangenberg et al. 2013): bit i tells whether the i-th pixel of the window in
// raster order is >= its mirror. Plain (Zabih and Woodfill 1994): whether it is < the centre. With a contrast: whether it differs by more than that
// share of the range of counts around (src/reference/census.h).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/match_push.h"

const uint tile_width = 64u, tile_height = 4u;
layout(local_size_x = tile_width, local_size_y = tile_height) in;
layout(constant_id = 0) const uint window_width = 7u;
layout(constant_id = 1) const uint window_height = 7u;
layout(constant_id = 2) const uint copies = 4u;  // of the right words, each one column further right
layout(constant_id = 3) const uint plain = 0u;
layout(constant_id = 4) const uint census_words = 1u;  // 2 where a plain window has more than 32 bits
layout(constant_id = 5) const uint element_bytes = 1u;  // of the images
layout(constant_id = 6) const uint keep_gray = 0u;
layout(constant_id = 7) const uint contrast = 0u;  // 256ths
layout(push_constant, scalar) uniform Push { CensusPush push; };

const uint margin = contrast > 0u ? 2u : 0u;  // how far beyond the window the range is taken
const uint shared_width = tile_width + window_width - 1u + 2u * margin, shared_height = tile_height + window_height - 1u + 2u * margin;
const uint extreme_count = contrast > 0u ? shared_width * tile_height : 1u;
shared uint pixels[shared_width * shared_height];
shared uint extremes[extreme_count];  // of a column over the window's height: lowest count, highest << 16

uint pixel(bool right, int x, int y) {
  ivec2 inside = clamp(ivec2(x, y), ivec2(0), ivec2(push.width, push.height) - 1);
  if (contrast == 0u && inside != ivec2(x, y)) return 0u;
  uint element = (gl_WorkGroupID.z >> 1) * push.image_stride + uint(inside.y) * push.image_pitch + uint(inside.x);
  uint byte = (right ? push.right_byte : push.left_byte) + element * element_bytes;
  uint word = right ? push.right_image.at[byte >> 2] : push.left_image.at[byte >> 2];
  return word >> (8u * (byte & 3u)) & (element_bytes == 1u ? 0xffu : 0xffffu);
}

void load_tile(bool right, ivec2 origin) {
  for (uint i = gl_LocalInvocationIndex; i < shared_width * shared_height; i += tile_width * tile_height) {
    ivec2 at = origin + ivec2(i % shared_width, i / shared_width) - ivec2(window_width / 2u + margin, window_height / 2u + margin);
    pixels[i] = pixel(right, at.x, at.y);
  }
}

void find_column_extremes() {
  for (uint i = gl_LocalInvocationIndex; i < extreme_count; i += tile_width * tile_height) {
    uint low = 0xffffu, high = 0u;
    for (uint k = 0u; k < window_height + 2u * margin; ++k) {
      uint count = pixels[i + k * shared_width];
      low = min(low, count);
      high = max(high, count);
    }
    extremes[i] = low | high << 16;
  }
}

/// 256 times the largest difference that counts as none. first: of the extremes of its columns.
int insignificant_256(uint first) {
  if (contrast == 0u) return 0;
  uint low = 0xffffu, high = 0u;
  for (uint k = 0u; k < window_width + 2u * margin; ++k) {
    low = min(low, extremes[first + k] & 0xffffu);
    high = max(high, extremes[first + k] >> 16);
  }
  return int(contrast * (high - low));
}

bool is_above(uint brighter, uint darker, int insignificant) { return 256 * (int(brighter) - int(darker)) > insignificant; }

uvec2 center_symmetric_word(uint first, int insignificant) {
  uint last = first + (window_height - 1u) * shared_width + window_width - 1u, bits = 0u;
  [[unroll]] for (uint i = 0u; i < (window_width * window_height - 1u) / 2u; ++i) {
    uint offset = i / window_width * shared_width + i % window_width;
    uint pixel = pixels[first + offset], mirror = pixels[last - offset];
    bool first_turn = (i & 1u) == 0u;
    bool set = contrast == 0u ? pixel >= mirror : is_above(first_turn ? pixel : mirror, first_turn ? mirror : pixel, insignificant);
    if (set) bits |= 1u << i;
  }
  return uvec2(bits, 0u);
}

uvec2 plain_word(uint first, int insignificant) {
  const uint cells = window_width * window_height;
  uint centre = pixels[first + window_height / 2u * shared_width + window_width / 2u];
  uvec2 bits = uvec2(0u);
  [[unroll]] for (uint i = 0u; i < cells; ++i) {
    if (i == cells / 2u) continue;
    uint bit = i < cells / 2u ? i : i - 1u;
    if (is_above(centre, pixels[first + i / window_width * shared_width + i % window_width], insignificant)) bits[bit / 32u] |= 1u << (bit % 32u);
  }
  return bits;
}

void store_words(UintArray to, uint at, uvec2 words) {
  to.at[at * census_words] = words.x;
  if (census_words == 2u) to.at[at * census_words + 1u] = words.y;
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
    find_column_extremes();
    barrier();
  }
  int x = tile_x + int(gl_LocalInvocationID.x), y = tile_y + int(gl_LocalInvocationID.y);
  if (x < -int(push.right_origin) || x > last_x || y >= int(push.height)) return;
  uint outermost = gl_LocalInvocationID.y * shared_width + uint(clamp(x - shift, 0, last_x) - source_x);
  int insignificant = insignificant_256(outermost);
  uint first = outermost + margin * shared_width + margin;
  uvec2 words = plain != 0u ? plain_word(first, insignificant) : center_symmetric_word(first, insignificant);
  uint row = (gl_WorkGroupID.z >> 1) * push.height + uint(y);
  if (!right) {
    uint at = row * push.width + uint(x);
    store_words(push.left_census, at + left_margin, words);
    if (keep_gray != 0u) push.gray.at[at + left_margin] = pixels[first + window_height / 2u * shared_width + window_width / 2u];
    push.right_winner.at[at] = 0xffffffffu;
    return;
  }
  uint at = uint(int(row * push.right_pitch + push.right_origin) + x);
  for (uint copy = 0u; copy < copies; ++copy) store_words(push.right_census, copy * push.right_copy_words + at + copy, words);
}
