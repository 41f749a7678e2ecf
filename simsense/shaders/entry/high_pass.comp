// SPDX-License-Identifier: Apache-2.0
// First pass of the check for more than noise (match/detection.h): each count less the mean of the square about it, of the right
// image; of the left one, the energy of the sum with that which its disparity meets.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/counts.glsl"
#include "shared/detection_push.h"

layout(local_size_x = DETECTION_GROUP, local_size_y = DETECTION_GROUP) in;
layout(push_constant, scalar) uniform Push { HighPassPush push; };

const uint group = uint(DETECTION_GROUP), widest = group + 2u * uint(DETECTION_REACH / 2);
shared int counts[widest * widest];
shared int row_sums[widest * group];

int count_of(ivec2 pixel) {
  uvec2 inside = uvec2(clamp(pixel, ivec2(0), ivec2(push.width, push.height) - 1));
  return count_at(push.image, push.first_byte, push.bits,
                  gl_WorkGroupID.z * push.image_stride + inside.y * push.image_pitch + inside.x);
}

void main() {
  uint side = push.mean_side, reach = side / 2u, tile = group + 2u * reach;
  ivec2 origin = ivec2(gl_WorkGroupID.xy * group) - int(reach);
  for (uint i = gl_LocalInvocationIndex; i < tile * tile; i += group * group) counts[i] = count_of(origin + ivec2(i % tile, i / tile));
  barrier();
  for (uint i = gl_LocalInvocationIndex; i < tile * group; i += group * group) {
    uint first = i / group * tile + i % group;
    int sum = 0;
    for (uint k = first; k < first + side; ++k) sum += counts[k];
    row_sums[i] = sum;
  }
  barrier();
  uvec2 pixel = gl_GlobalInvocationID.xy, local = gl_LocalInvocationID.xy;
  if (pixel.x >= push.width || pixel.y >= push.height) return;
  int sum = 0;
  for (uint row = local.y; row < local.y + side; ++row) sum += row_sums[row * group + local.x];
  int count = counts[(local.y + reach) * tile + local.x + reach];
  int difference = (int(side * side) * count - sum) * 8 >> extra_bits;
  int h = clamp((difference * push.part + 32768) >> 16, -DETECTION_LARGEST, DETECTION_LARGEST);
  uint row = gl_WorkGroupID.z * push.height + pixel.y, at = row * push.width + pixel.x;
  if (push.is_left == 0u) {
    push.high.at[at] = uint8_t(h & 0xff);
    return;
  }
  float disparity = push.found.at[at];
  precise float above = disparity + 0.5f;
  int column = int(pixel.x) - int(floor(above));
  bool counts = disparity != push.invalid && column >= 0 && column < int(push.width);
  int both = counts ? h + (int(push.high.at[row * push.width + uint(column)]) << 24 >> 24) : 0, v = count >> extra_bits;
  DetectionNoise n = push.noise;
  int noise = n.dark + (n.per_count + n.per_count2 * v) * v >> DETECTION_NOISE_BITS;
  push.energy.at[at] = counts ? uint(both * both) << 16u | uint(clamp(noise, n.least, DETECTION_MOST_NOISE)) : 0u;
}
