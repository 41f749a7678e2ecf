// SPDX-License-Identifier: Apache-2.0
// Third pass of the check by correlation (match/correlation.h): disparities go near 3 x 3 px whose near windows fail.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared/correlation_push.h"

layout(local_size_x = CORRELATION_GROUP, local_size_y = CORRELATION_GROUP) in;
layout(push_constant, scalar) uniform Push { CorrelationPush push; };

const uint group = uint(CORRELATION_GROUP), widest = group + 2u * uint(CORRELATION_BARE);
shared uint bare[(widest + 2u) * (widest + 2u)];  // then whether a row has a block within reach, [tile][group]
shared uint blocks[widest * widest];              // whether all of 3 x 3 px are bare

uint pixel_of(ivec2 pixel) { return (gl_WorkGroupID.z * push.height + uint(pixel.y)) * push.width + uint(pixel.x); }

uint bare_at(ivec2 pixel) {
  bool inside = all(greaterThanEqual(pixel, ivec2(0))) && pixel.x < int(push.width) && pixel.y < int(push.height);
  return inside ? uint(push.bare.at[pixel_of(pixel)]) : 0u;
}

void main() {
  uint reach = push.bare_reach, tile = group + 2u * reach, outer = tile + 2u, local = gl_LocalInvocationIndex;
  ivec2 origin = ivec2(gl_WorkGroupID.xy * group) - int(reach) - 1;
  for (uint i = local; i < outer * outer; i += group * group) bare[i] = bare_at(origin + ivec2(i % outer, i / outer));
  barrier();
  for (uint i = local; i < tile * tile; i += group * group) {
    uint first = i / tile * outer + i % tile, found = 1u;
    for (uint k = 0u; k < 9u; ++k) found &= bare[first + k / 3u * outer + k % 3u];
    blocks[i] = found;
  }
  barrier();
  for (uint i = local; i < tile * group; i += group * group) {
    uint first = i / group * tile + i % group, found = 0u;
    for (uint k = first; k <= first + 2u * reach; ++k) found |= blocks[k];
    bare[i] = found;
  }
  barrier();
  uint found = 0u;
  for (uint row = gl_LocalInvocationID.y; row <= gl_LocalInvocationID.y + 2u * reach; ++row) found |= bare[row * group + gl_LocalInvocationID.x];
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (found == 0u || pixel.x >= int(push.width) || pixel.y >= int(push.height)) return;
  uint at = pixel_of(pixel);
  if (push.disparity.at[at] == push.invalid) return;
  push.disparity.at[at] = push.invalid;
  if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[at] = 0.0f;
  if ((push.maps & MAPS_REASON) != 0u) push.reason.at[at] = uint8_t(REASON_LOW_TEXTURE);
}
