// SPDX-License-Identifier: Apache-2.0
// Second pass of the check by correlation (match/correlation.h): disparities go where both images have too little in common around them.
// Sums move along rows, then down columns, a pixel at a time. Vulkan grants 16 KB of shared memory: two pixels share a word.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/correlation_push.h"

layout(local_size_x = CORRELATION_GROUP, local_size_y = CORRELATION_GROUP / CORRELATION_RUN) in;
layout(push_constant, scalar) uniform Push { CorrelationPush push; };

const uint group = uint(CORRELATION_GROUP), run = uint(CORRELATION_RUN), invocations = group * group / run;
const uint most_rows = group + 2u * uint(CORRELATION_REACH), margin = uint(CORRELATION_REACH) + 1u;  // margin: an even number of columns
// Rows, one to an invocation, begin in different banks of the shared memory.
const uint tile_words = group / 2u + margin, row_pairs = tile_words + 1u, row_words = 3u * group + 1u;
shared uint pairs[most_rows * row_pairs];    // of two pixels next to each other: right h << 8 | left h, 16 bits each
shared int row_sums[most_rows * row_words];  // products, squares of the left with the pixels that count above them, squares of the right
const uint count_shift = 24u;                // a row's squares stay below
shared uint bare_rows[group];

uint pixel_of(ivec2 pixel) { return (gl_WorkGroupID.z * push.height + uint(pixel.y)) * push.width + uint(pixel.x); }

int signed_byte(uint value) { return int(value) << 24 >> 24; }

/// What a pixel of the tile adds to a row's sums.
ivec3 terms(uint row, uint column) {
  uint pair = pairs[row * row_pairs + column / 2u] >> 16u * (column & 1u) & 0xffffu;
  int left = signed_byte(pair), right = signed_byte(pair >> 8u);
  return ivec3(left * right, left * left + (pair != 0u ? 1 << count_shift : 0), right * right);
}

/// Products, squares of the left and of the right, pixels, of a window's row.
ivec4 row_sum(uint row) {
  uint at = row * row_words + 3u * gl_LocalInvocationID.x;
  int left = row_sums[at + 1u];
  return ivec4(row_sums[at], left & (1 << count_shift) - 1, row_sums[at + 2u], left >> count_shift);
}

/// The same over the windows of this reach about the invocation's pixels.
void find_sums(int reach, out ivec4 sums[run]) {
  uint last = 2u * uint(reach), rows = group + last, above = uint(push.reach - reach), beside = margin - uint(reach);
  barrier();
  for (uint row = gl_LocalInvocationIndex; row < rows; row += invocations) {
    ivec3 sum = ivec3(0);
    for (uint k = 0u; k < last; ++k) sum += terms(row + above, beside + k);
    for (uint x = 0u; x < group; ++x) {
      sum += terms(row + above, beside + x + last);
      [[unroll]] for (uint k = 0u; k < 3u; ++k) row_sums[row * row_words + 3u * x + k] = sum[k];
      sum -= terms(row + above, beside + x);
    }
  }
  barrier();
  uint first = gl_LocalInvocationID.y * run;
  ivec4 sum = ivec4(0);
  for (uint k = 0u; k < last; ++k) sum += row_sum(first + k);
  [[unroll]] for (uint k = 0u; k < run; ++k) {
    sum += row_sum(first + k + last);
    sums[k] = sum;
    sum -= row_sum(first + k);
  }
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
  uvec2 local = gl_LocalInvocationID.xy;
  ivec2 origin = ivec2(gl_WorkGroupID.xy * group) - ivec2(margin, push.reach);
  for (uint i = gl_LocalInvocationIndex; i < (group + 2u * uint(push.reach)) * tile_words; i += invocations) {
    int column = origin.x + 2 * int(i % tile_words), row = origin.y + int(i / tile_words);
    bool inside = row >= 0 && row < int(push.height) && column >= 0 && column < int(push.width);
    uint words = (push.width + 1u) / 2u, at = (gl_WorkGroupID.z * push.height + uint(row)) * words + uint(column) / 2u;
    uint found = inside ? push.pairs.at[at] : 0u;
    pairs[i / tile_words * row_pairs + i % tile_words] = column + 1 < int(push.width) ? found : found & 0xffffu;
  }
  if (gl_LocalInvocationIndex < group) bare_rows[gl_LocalInvocationIndex] = 0u;
  ivec4 wide[run], near[run];
  find_sums(push.reach, wide);
  find_sums(push.near_reach, near);
  [[unroll]] for (uint k = 0u; k < run; ++k) {
    uint row = local.y * run + k;
    ivec2 pixel = ivec2(gl_WorkGroupID.xy * group + uvec2(local.x, row));
    if (pixel.x >= int(push.width) || pixel.y >= int(push.height)) continue;
    uint at = pixel_of(pixel);
    float disparity = push.found.at[at];
    bvec2 own = correlates(wide[k], near[k]);
    bool is_found = disparity != push.invalid, goes = is_found && !all(own);
    if (!own.y && (is_found || near[k].w > 0)) atomicOr(bare_rows[row], 1u << local.x);
    push.disparity.at[at] = goes ? push.invalid : disparity;
    if (!goes) continue;
    if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[at] = 0.0f;
    if ((push.maps & MAPS_REASON) != 0u) push.reason.at[at] = uint8_t(REASON_LOW_TEXTURE);
  }
  barrier();
  uint row = gl_LocalInvocationIndex, y = gl_WorkGroupID.y * group + row;
  if (row < group && y < push.height)
    push.bare.at[(gl_WorkGroupID.z * push.height + y) * gl_NumWorkGroups.x + gl_WorkGroupID.x] = bare_rows[row];
}
