// Census words of both images of each pair. Center-symmetric (Spangenberg et al. 2013): bit i tells whether the i-th pixel of the window in
// raster order is >= its mirror. Plain (Zabih and Woodfill 1994): whether it is < the centre.
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
layout(push_constant, scalar) uniform Push { CensusPush push; };

const uint shared_width = tile_width + window_width - 1u, shared_height = tile_height + window_height - 1u;
shared uint pixels[shared_width * shared_height];

uint pixel(bool right, int x, int y) {
  if (x < 0 || y < 0 || x >= int(push.width) || y >= int(push.height)) return 0u;
  uint element = (gl_WorkGroupID.z >> 1) * push.image_stride + uint(y) * push.image_pitch + uint(x);
  uint byte = (right ? push.right_byte : push.left_byte) + element * element_bytes;
  uint word = right ? push.right_image.at[byte >> 2] : push.left_image.at[byte >> 2];
  return word >> (8u * (byte & 3u)) & (element_bytes == 1u ? 0xffu : 0xffffu);
}

void load_tile(bool right, ivec2 origin) {
  for (uint i = gl_LocalInvocationIndex; i < shared_width * shared_height; i += tile_width * tile_height) {
    ivec2 at = origin + ivec2(i % shared_width, i / shared_width) - ivec2(window_width / 2u, window_height / 2u);
    pixels[i] = pixel(right, at.x, at.y);
  }
}

uvec2 center_symmetric_word(uint first) {
  uint last = first + (window_height - 1u) * shared_width + window_width - 1u, bits = 0u;
  [[unroll]] for (uint i = 0u; i < (window_width * window_height - 1u) / 2u; ++i) {
    uint offset = i / window_width * shared_width + i % window_width;
    if (pixels[first + offset] >= pixels[last - offset]) bits |= 1u << i;
  }
  return uvec2(bits, 0u);
}

uvec2 plain_word(uint first) {
  const uint cells = window_width * window_height;
  uint centre = pixels[first + window_height / 2u * shared_width + window_width / 2u];
  uvec2 bits = uvec2(0u);
  [[unroll]] for (uint i = 0u; i < cells; ++i) {
    if (i == cells / 2u) continue;
    uint bit = i < cells / 2u ? i : i - 1u;
    if (pixels[first + i / window_width * shared_width + i % window_width] < centre) bits[bit / 32u] |= 1u << (bit % 32u);
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
  int x = tile_x + int(gl_LocalInvocationID.x), y = tile_y + int(gl_LocalInvocationID.y);
  if (x < -int(push.right_origin) || x > last_x || y >= int(push.height)) return;
  uint first = gl_LocalInvocationID.y * shared_width + uint(clamp(x - shift, 0, last_x) - source_x);
  uvec2 words = plain != 0u ? plain_word(first) : center_symmetric_word(first);
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
