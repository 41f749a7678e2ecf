// SPDX-License-Identifier: Apache-2.0
// Left-right check and median. A tile of checked disparities stands in shared memory; invalid ones (-1) take part in the median, pixels
// whose window leaves the image are copied.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/match_constants.glsl"
#include "shared/match_push.h"

const uint tile_width = 32u, row_threads = 8u, thread_rows = 2u, tile_height = row_threads * thread_rows;
layout(local_size_x = tile_width, local_size_y = row_threads) in;
layout(push_constant, scalar) uniform Push { MedianPush push; };

const uint reach = median_size / 2u, values = median_size * median_size;
const uint shared_width = tile_width + 2u * reach, shared_height = tile_height + 2u * reach;
shared float checked[shared_width * shared_height];

/// -1 where the check fails, and why.
float checked_disparity(int x, int y, out uint reason) {
  reason = REASON_NOT_UNIQUE;
  if (x < 0 || y < 0 || x >= int(push.width) || y >= int(push.height)) return -1.0f;
  uint row = (gl_WorkGroupID.z * push.height + uint(y)) * push.width;
  float disparity = push.unchecked.at[row + uint(x)];
  if (disparity < 0.0f) return disparity;
  reason = REASON_VALID;
  if (push.lr_max_diff < 0) return disparity;
  int rounded = int(floor(disparity + 0.5f)), right_x = x - rounded - push.min_disparity;
  reason = REASON_OUTSIDE;
  if (right_x < 0 || right_x >= int(push.width)) return -1.0f;
  int right = int(push.right_winner.at[row + uint(right_x)] & 0xffffu);
  bool agree = abs(rounded - right) <= push.lr_max_diff;
  reason = agree ? REASON_VALID : REASON_OCCLUDED;
  return agree ? disparity : -1.0f;
}

float middle(float a, float b, float c) { return max(min(a, b), min(max(a, b), c)); }

const uint most_kept = values / 2u + 2u, both_have = values - median_size;  // values that the windows of two pixels share, one below the other
const uint begun_kept = median_size + 3u;  // when those values are in
float kept[most_kept + 2u], begun[begun_kept];

void sort_kept(uint a, uint b) {
  float low = min(kept[a], kept[b]);
  kept[b] = max(kept[a], kept[b]);
  kept[a] = low;
}

/// Of half of the values and two more, the least and the greatest cannot be the median: they are forgotten, and the next value comes in.
void forget(uint count, float next) {
  [[unroll]] for (uint i = 0u; i < count / 2u; ++i) sort_kept(i, count - 1u - i);
  [[unroll]] for (uint i = 1u; i < (count + 1u) / 2u; ++i) sort_kept(0u, i);
  [[unroll]] for (uint i = count / 2u; i < count - 1u; ++i) sort_kept(i, count - 1u);
  kept[0] = next;
}

/// Values in the order that they come in: first those that both windows have, from the place `first` on, then a row of one.
float next_value(uint first, uint own_row, uint i) {
  return i < both_have ? checked[first + i / median_size * shared_width + i % median_size] : checked[own_row + i - both_have];
}

void begin_median(uint first) {
  [[unroll]] for (uint i = 0u; i < most_kept; ++i) kept[i] = next_value(first, 0u, i);
  [[unroll]] for (uint count = most_kept; count > begun_kept; --count) forget(count, next_value(first, 0u, 2u * most_kept - count));
}

float end_median(uint first, uint own_row) {
  [[unroll]] for (uint count = begun_kept; count > 3u; --count) forget(count, next_value(first, own_row, 2u * most_kept - count));
  return middle(kept[0], kept[1], kept[2]);
}

void write_pixel(uvec2 pixel, float disparity) {
  uint reason, at = (gl_WorkGroupID.z * push.height + pixel.y) * push.width + pixel.x;
  bool valid = disparity >= 0.0f;
  push.disparity.at[at] = valid ? disparity + float(push.min_disparity) : float(min(push.min_disparity, 0) - 1);
  if ((push.maps & MAPS_CONFIDENCE) != 0u && !valid) push.confidence.at[at] = 0.0f;
  if ((push.maps & MAPS_REASON) == 0u) return;
  checked_disparity(int(pixel.x), int(pixel.y), reason);
  push.reason.at[at] = uint8_t(valid ? REASON_VALID : reason == REASON_VALID ? REASON_ISOLATED : reason);
}

void main() {
  ivec2 origin = ivec2(gl_WorkGroupID.xy) * ivec2(tile_width, tile_height) - int(reach);
  uint reason;
  for (uint i = gl_LocalInvocationIndex; i < shared_width * shared_height; i += tile_width * row_threads)
    checked[i] = checked_disparity(origin.x + int(i % shared_width), origin.y + int(i / shared_width), reason);
  barrier();
  uvec2 local = gl_LocalInvocationID.xy * uvec2(1u, thread_rows), pixel = gl_WorkGroupID.xy * uvec2(tile_width, tile_height) + local;
  if (pixel.x >= push.width) return;
  uint above = local.y * shared_width + local.x, first = above + shared_width, below = above + median_size * shared_width;
  bool filters = values > 1u && pixel.x >= reach && pixel.x + reach < push.width;
  if (filters) begin_median(first);
  [[unroll]] for (uint i = 0u; i < begun_kept; ++i) begun[i] = kept[i];
  [[unroll]] for (uint n = 0u; n < thread_rows; ++n) {
    uint y = pixel.y + n;
    if (y >= push.height) return;
    [[unroll]] for (uint i = 0u; i < begun_kept; ++i) kept[i] = begun[i];
    bool inside = filters && y >= reach && y + reach < push.height;
    write_pixel(uvec2(pixel.x, y), inside ? end_median(first, n == 0u ? above : below) : checked[above + (n + reach) * shared_width + reach]);
  }
}
