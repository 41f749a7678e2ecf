// SPDX-License-Identifier: Apache-2.0
// Left-right check and median. A tile of checked disparities stands in shared memory; invalid ones (-1) take part in the median, pixels
// whose window leaves the image are copied.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/match_constants.glsl"
#include "shared/match_push.h"

const uint tile_width = 32u, tile_height = 8u;
layout(local_size_x = tile_width, local_size_y = tile_height) in;
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

float window_value(uint first, uint i) { return checked[first + i / median_size * shared_width + i % median_size]; }

const uint most_kept = values / 2u + 2u;
float kept[most_kept + 1u];  // at least the three that are left

void sort_kept(uint a, uint b) {
  float low = min(kept[a], kept[b]);
  kept[b] = max(kept[a], kept[b]);
  kept[a] = low;
}

/// Of half of the values and two more, the least and the greatest cannot be the median: they are forgotten, and the next value comes in.
float median(uint first) {
  if (values == 1u) return checked[first];
  [[unroll]] for (uint i = 0u; i < most_kept; ++i) kept[i] = window_value(first, i);
  [[unroll]] for (uint count = most_kept; count > 3u; --count) {
    [[unroll]] for (uint i = 0u; i < count / 2u; ++i) sort_kept(i, count - 1u - i);
    [[unroll]] for (uint i = 1u; i < (count + 1u) / 2u; ++i) sort_kept(0u, i);
    [[unroll]] for (uint i = count / 2u; i < count - 1u; ++i) sort_kept(i, count - 1u);
    kept[0] = window_value(first, 2u * most_kept - count);
  }
  return middle(kept[0], kept[1], kept[2]);
}

void main() {
  ivec2 origin = ivec2(gl_WorkGroupID.xy) * ivec2(tile_width, tile_height) - int(reach);
  uint reason;
  for (uint i = gl_LocalInvocationIndex; i < shared_width * shared_height; i += tile_width * tile_height)
    checked[i] = checked_disparity(origin.x + int(i % shared_width), origin.y + int(i / shared_width), reason);
  barrier();
  uvec2 pixel = gl_GlobalInvocationID.xy, local = gl_LocalInvocationID.xy;
  if (pixel.x >= push.width || pixel.y >= push.height) return;
  bool inside = pixel.x >= reach && pixel.y >= reach && pixel.x + reach < push.width && pixel.y + reach < push.height;
  uint first = local.y * shared_width + local.x;
  float disparity = inside ? median(first) : checked[first + reach * shared_width + reach];
  uint at = (gl_WorkGroupID.z * push.height + pixel.y) * push.width + pixel.x;
  bool valid = disparity >= 0.0f;
  push.disparity.at[at] = valid ? disparity + float(push.min_disparity) : float(min(push.min_disparity, 0) - 1);
  if ((push.maps & MAPS_CONFIDENCE) != 0u && !valid) push.confidence.at[at] = 0.0f;
  if ((push.maps & MAPS_REASON) == 0u) return;
  checked_disparity(int(pixel.x), int(pixel.y), reason);
  push.reason.at[at] = uint8_t(valid ? REASON_VALID : reason == REASON_VALID ? REASON_ISOLATED : reason);
}
