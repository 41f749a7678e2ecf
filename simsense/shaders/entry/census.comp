// Center-symmetric census words of both images of each pair (Spangenberg et al. 2013): bit i tells whether the i-th pixel of the window in
// raster order is >= its mirror. Columns left of the right image repeat its first one, so that no disparity needs a check later.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/match_push.h"

const uint tile_width = 64u, tile_height = 4u;
layout(local_size_x = tile_width, local_size_y = tile_height) in;
layout(constant_id = 0) const uint window_width = 7u;
layout(constant_id = 1) const uint window_height = 7u;
layout(constant_id = 2) const uint copies = 4u;  // of the right words, each one column further right
layout(push_constant, scalar) uniform Push { MatchPush push; };

const uint shared_width = tile_width + window_width - 1u, shared_height = tile_height + window_height - 1u;
shared uint pixels[shared_width * shared_height];

uint pixel(bool right, int x, int y) {
  if (x < 0 || y < 0 || x >= int(push.width) || y >= int(push.height)) return 0u;
  uint byte = (right ? push.right_byte : push.left_byte) + ((gl_WorkGroupID.z >> 1) * push.height + uint(y)) * push.width + uint(x);
  uint word = right ? push.right_image.at[byte >> 2] : push.left_image.at[byte >> 2];
  return word >> (8u * (byte & 3u)) & 255u;
}

void load_tile(bool right, ivec2 origin) {
  for (uint i = gl_LocalInvocationIndex; i < shared_width * shared_height; i += tile_width * tile_height) {
    ivec2 at = origin + ivec2(i % shared_width, i / shared_width) - ivec2(window_width / 2u, window_height / 2u);
    pixels[i] = pixel(right, at.x, at.y);
  }
}

/// Census word around column x, row y of the tile.
uint census_word(uint x, uint y) {
  uint first = y * shared_width + x, last = first + (window_height - 1u) * shared_width + window_width - 1u;
  uint bits = 0u;
  [[unroll]] for (uint i = 0u; i < (window_width * window_height - 1u) / 2u; ++i) {
    uint offset = i / window_width * shared_width + i % window_width;
    if (pixels[first + offset] >= pixels[last - offset]) bits |= 1u << i;
  }
  return bits;
}

void main() {
  bool right = (gl_WorkGroupID.z & 1u) != 0u;
  uint outside_tiles = (push.right_origin + tile_width - 1u) / tile_width;
  int tile_x = (int(gl_WorkGroupID.x) - int(outside_tiles)) * int(tile_width), tile_y = int(gl_WorkGroupID.y * tile_height);
  bool outside = tile_x < 0;
  if (outside && !right) return;
  load_tile(right, ivec2(outside ? 0 : tile_x, tile_y));
  barrier();
  int x = tile_x + int(gl_LocalInvocationID.x), y = tile_y + int(gl_LocalInvocationID.y);
  if (x < -int(push.right_origin) || x >= int(push.width) || y >= int(push.height)) return;
  uint word = census_word(outside ? 0u : gl_LocalInvocationID.x, gl_LocalInvocationID.y);
  uint row = (gl_WorkGroupID.z >> 1) * push.height + uint(y);
  if (!right) {
    push.left_census.at[row * push.width + uint(x) + left_margin] = word;
    push.right_winner.at[row * push.width + uint(x)] = 0xffffffffu;
    return;
  }
  uint at = uint(int(row * push.right_pitch + push.right_origin) + x);
  for (uint copy = 0u; copy < copies; ++copy) push.right_census.at[copy * push.right_copy_words + at + copy] = word;
}
