// SPDX-License-Identifier: Apache-2.0
// Second pass of the check by correlation (match/correlation.h): disparities go where both images have too little in common around them.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared/correlation_push.h"

layout(local_size_x = CORRELATION_GROUP, local_size_y = CORRELATION_GROUP) in;
layout(push_constant, scalar) uniform Push { CorrelationPush push; };

const uint group = uint(CORRELATION_GROUP), widest = group + 2u * uint(CORRELATION_REACH);
shared int pairs[widest * widest];         // left h << 16 | right h
shared ivec3 row_sums[widest * group];  // products, squares of the left and of the right

uint pixel_of(ivec2 pixel) { return (gl_WorkGroupID.z * push.height + uint(pixel.y)) * push.width + uint(pixel.x); }

int signed_byte(uint value) { return int(value) << 24 >> 24; }

int pair_at(ivec2 pixel) {
  if (any(lessThan(pixel, ivec2(0))) || pixel.x >= int(push.width) || pixel.y >= int(push.height)) return 0;
  uint at = pixel_of(pixel);
  float disparity = push.found.at[at];
  if (disparity == push.invalid) return 0;
  precise float above = disparity + 0.5f;
  int column = pixel.x - int(floor(above));
  if (column < 0 || column >= int(push.width)) return 0;
  return signed_byte(uint(push.left.at[at])) << 16 | signed_byte(uint(push.right.at[pixel_of(ivec2(column, pixel.y))])) & 0xffff;
}

bool correlates(ivec3 sums) {
  precise float both = float(sums.x) * float(sums.x);
  precise float share = push.least * push.least;
  precise float left = share * float(sums.y);
  precise float least = left * float(sums.z);
  return sums.x > 0 && both >= least;
}

void main() {
  uint side = 2u * uint(push.reach) + 1u, tile = group + 2u * uint(push.reach);
  ivec2 origin = ivec2(gl_WorkGroupID.xy * group) - push.reach;
  for (uint i = gl_LocalInvocationIndex; i < tile * tile; i += group * group) pairs[i] = pair_at(origin + ivec2(i % tile, i / tile));
  barrier();
  for (uint i = gl_LocalInvocationIndex; i < tile * group; i += group * group) {
    uint first = i / group * tile + i % group;
    ivec3 sums = ivec3(0);
    for (uint k = first; k < first + side; ++k) {
      int left = pairs[k] >> 16, right = pairs[k] << 16 >> 16;
      sums += ivec3(left * right, left * left, right * right);
    }
    row_sums[i] = sums;
  }
  barrier();
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  uvec2 local = gl_LocalInvocationID.xy;
  if (pixel.x >= int(push.width) || pixel.y >= int(push.height)) return;
  ivec3 sums = ivec3(0);
  for (uint row = local.y; row < local.y + side; ++row) sums += row_sums[row * group + local.x];
  uint at = pixel_of(pixel);
  float disparity = push.found.at[at];
  bool goes = disparity != push.invalid && !correlates(sums);
  push.disparity.at[at] = goes ? push.invalid : disparity;
  if (!goes) return;
  if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[at] = 0.0f;
  if ((push.maps & MAPS_REASON) != 0u) push.reason.at[at] = uint8_t(REASON_LOW_TEXTURE);
}
