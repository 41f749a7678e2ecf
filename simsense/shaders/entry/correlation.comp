// SPDX-License-Identifier: Apache-2.0
// Second pass of the check by correlation (match/correlation.h): disparities go where both images have too little in common around them.
// Vulkan grants 16 KB of shared memory: two pixels share a word.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared/correlation_push.h"

layout(local_size_x = CORRELATION_GROUP, local_size_y = CORRELATION_GROUP) in;
layout(push_constant, scalar) uniform Push { CorrelationPush push; };

const uint group = uint(CORRELATION_GROUP), widest = group + 2u * uint(CORRELATION_REACH);
shared uint pairs[widest * widest / 2u];  // of two pixels next to each other: right h << 8 | left h, 16 bits each
shared ivec3 row_sums[widest * group];  // products, squares of the left with the pixels that count above them, squares of the right
const uint count_shift = 24u;           // a row's squares stay below

uint pixel_of(ivec2 pixel) { return (gl_WorkGroupID.z * push.height + uint(pixel.y)) * push.width + uint(pixel.x); }

int signed_byte(uint value) { return int(value) << 24 >> 24; }

uint pair_at(ivec2 pixel) {
  if (any(lessThan(pixel, ivec2(0))) || pixel.x >= int(push.width) || pixel.y >= int(push.height)) return 0u;
  uint at = pixel_of(pixel);
  float disparity = push.found.at[at];
  if (disparity == push.invalid) return 0u;
  precise float above = disparity + 0.5f;
  int column = pixel.x - int(floor(above));
  if (column < 0 || column >= int(push.width)) return 0u;
  return uint(push.right.at[pixel_of(ivec2(column, pixel.y))]) << 8u | uint(push.left.at[at]);
}

/// Products, squares of the left and of the right, pixels, over the window of this reach about the invocation's pixel.
ivec4 window_sums(int reach) {
  uint side = 2u * uint(reach) + 1u, rows = group + 2u * uint(reach), tile = group + 2u * uint(push.reach), inset = uint(push.reach - reach);
  barrier();
  for (uint i = gl_LocalInvocationIndex; i < rows * group; i += group * group) {
    uint first = (i / group + inset) * tile + i % group + inset;
    ivec3 sums = ivec3(0);
    for (uint k = first; k < first + side; ++k) {
      uint pair = pairs[k >> 1u] >> 16u * (k & 1u) & 0xffffu;
      int left = signed_byte(pair), right = signed_byte(pair >> 8u);
      sums += ivec3(left * right, left * left + (pair != 0u ? 1 << count_shift : 0), right * right);
    }
    row_sums[i] = sums;
  }
  barrier();
  ivec4 sums = ivec4(0);
  for (uint row = gl_LocalInvocationID.y; row < gl_LocalInvocationID.y + side; ++row) {
    ivec3 found = row_sums[row * group + gl_LocalInvocationID.x];
    sums += ivec4(found.x, found.y & (1 << count_shift) - 1, found.z, found.y >> count_shift);
  }
  return sums;
}

/// By the wide window, and by the near one.
bvec2 correlates(ivec4 wide, ivec4 near) {
  precise float all = float(wide.y) * float(wide.z), near_all = float(near.y) * float(near.z);
  precise float square = float(wide.x) * float(wide.x), counted = square * float(wide.w);
  precise float share = push.least * push.least * push.area, least = share * all;
  precise float near_square = float(near.x) * abs(float(near.x)) * float(near.w), noise = CORRELATION_NOISE * near_all;
  precise float near_sum = near_square + noise, found = near_sum * all;
  precise float near_least = CORRELATION_SHARE * square * near_all * float(near.w);
  return bvec2(wide.x > 0 && counted >= least, found > near_least);
}

void main() {
  uint tile = group + 2u * uint(push.reach);
  ivec2 origin = ivec2(gl_WorkGroupID.xy * group) - push.reach;
  for (uint i = gl_LocalInvocationIndex; i < tile * tile / 2u; i += group * group) {  // a row has an even number of pixels
    ivec2 first = origin + ivec2(2u * i % tile, 2u * i / tile);
    pairs[i] = pair_at(first + ivec2(1, 0)) << 16u | pair_at(first);
  }
  ivec4 wide = window_sums(push.reach), near = window_sums(push.near_reach);
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (pixel.x >= int(push.width) || pixel.y >= int(push.height)) return;
  uint at = pixel_of(pixel);
  float disparity = push.found.at[at];
  bvec2 own = correlates(wide, near);
  bool is_found = disparity != push.invalid, goes = is_found && !all(own);
  push.bare.at[at] = uint8_t(!own.y && (is_found || near.w > 0) ? 1 : 0);
  push.disparity.at[at] = goes ? push.invalid : disparity;
  if (!goes) return;
  if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[at] = 0.0f;
  if ((push.maps & MAPS_REASON) != 0u) push.reason.at[at] = uint8_t(REASON_LOW_TEXTURE);
}
