// SPDX-License-Identifier: Apache-2.0
// Second pass of the check for more than noise (match/detection.h): disparities go where windows fail. Sums move along rows, then down
// columns, a pixel at a time. Vulkan grants 16 KB of shared memory: a row's energy and its pixels share a word.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/detection_push.h"

layout(local_size_x = DETECTION_GROUP, local_size_y = DETECTION_GROUP / DETECTION_RUN) in;
layout(push_constant, scalar) uniform Push { DetectionPush push; };

const uint group = uint(DETECTION_GROUP), run = uint(DETECTION_RUN), invocations = group * group / run;
const uint most_side = group + 2u * uint(DETECTION_REACH);
// Rows, one to an invocation, begin in different banks of the shared memory.
const uint row_words = 2u * group + 1u;
shared uint pixels[most_side * (most_side + 1u)];  // energy << 16 | noise
shared int row_sums[most_side * row_words];         // energy with the pixels that count above it, noise
const uint count_shift = 24u;                       // a row's energy stays below
shared uint bare_rows[group];

uint pixel_of(ivec2 pixel) { return (gl_WorkGroupID.z * push.height + uint(pixel.y)) * push.width + uint(pixel.x); }

/// What a pixel of the tile adds to a row's sums.
ivec2 terms(uint row, uint column) {
  uint pixel = pixels[row * (most_side + 1u) + column];
  return ivec2(pixel >> 16u, pixel & 0xffffu) + ivec2(pixel != 0u ? 1 << count_shift : 0, 0);
}

/// Energy, noise, pixels, of a window's row.
ivec3 row_sum(uint row) {
  uint at = row * row_words + 2u * gl_LocalInvocationID.x;
  int energy = row_sums[at];
  return ivec3(energy & (1 << count_shift) - 1, row_sums[at + 1u], energy >> count_shift);
}

bool detects(ivec3 sums) {
  precise float noise = float(sums.y), expected = DETECTION_OF_NOISE * noise, four = 4.0f * float(sums.x), excess = four - expected;
  precise float twice = 2.0f * push.least, share = twice * push.least, square = noise * noise;
  precise float excess_square = excess * excess, found = excess_square * float(sums.z), least = share * square;
  return (sums.z > push.most_matched && 32 * sums.x > sums.y) || (excess > 0.0f && found > least);
}

void main() {
  uvec2 local = gl_LocalInvocationID.xy;
  uint last = 2u * uint(push.reach), side = group + last;
  ivec2 origin = ivec2(gl_WorkGroupID.xy * group) - push.reach;
  for (uint i = gl_LocalInvocationIndex; i < side * side; i += invocations) {
    ivec2 pixel = origin + ivec2(i % side, i / side);
    bool inside = pixel.x >= 0 && pixel.y >= 0 && pixel.x < int(push.width) && pixel.y < int(push.height);
    pixels[i / side * (most_side + 1u) + i % side] = inside ? push.energy.at[pixel_of(pixel)] : 0u;
  }
  if (gl_LocalInvocationIndex < group) bare_rows[gl_LocalInvocationIndex] = 0u;
  barrier();
  for (uint row = gl_LocalInvocationIndex; row < side; row += invocations) {
    ivec2 sum = ivec2(0);
    for (uint k = 0u; k < last; ++k) sum += terms(row, k);
    for (uint x = 0u; x < group; ++x) {
      sum += terms(row, x + last);
      row_sums[row * row_words + 2u * x] = sum.x;
      row_sums[row * row_words + 2u * x + 1u] = sum.y;
      sum -= terms(row, x);
    }
  }
  barrier();
  uint first = local.y * run;
  ivec3 sum = ivec3(0);
  for (uint k = 0u; k < last; ++k) sum += row_sum(first + k);
  [[unroll]] for (uint k = 0u; k < run; ++k) {
    uint row = first + k;
    sum += row_sum(row + last);
    ivec3 sums = sum;
    sum -= row_sum(row);
    ivec2 pixel = ivec2(gl_WorkGroupID.xy * group + uvec2(local.x, row));
    if (pixel.x >= int(push.width) || pixel.y >= int(push.height)) continue;
    uint at = pixel_of(pixel);
    float disparity = push.found.at[at];
    bool is_found = disparity != push.invalid, fails = !detects(sums);
    if (fails && (is_found || sums.z > 0)) atomicOr(bare_rows[row], 1u << local.x);
    push.disparity.at[at] = fails ? push.invalid : disparity;
    if (!fails || !is_found) continue;
    if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[at] = 0.0f;
    if ((push.maps & MAPS_REASON) != 0u) push.reason.at[at] = uint8_t(REASON_LOW_TEXTURE);
  }
  barrier();
  uint row = gl_LocalInvocationIndex, y = gl_WorkGroupID.y * group + row;
  if (row < group && y < push.height)
    push.bare.at[(gl_WorkGroupID.z * push.height + y) * gl_NumWorkGroups.x + gl_WorkGroupID.x] = bare_rows[row];
}
