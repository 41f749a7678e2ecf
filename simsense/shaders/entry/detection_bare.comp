// SPDX-License-Identifier: Apache-2.0
// Third pass of the check for more than noise (match/detection.h): disparities go near 3 x 3 px whose windows fail.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared/detection_push.h"

layout(local_size_x = DETECTION_GROUP, local_size_y = DETECTION_GROUP) in;
layout(push_constant, scalar) uniform Push { DetectionPush push; };

// The tile's own columns are bits 24 to 39 of 64, which five words of a row reach into.
const uint group = uint(DETECTION_GROUP), most_rows = group + 2u * uint(DETECTION_BARE);
shared uvec2 bare[most_rows + 2u];  // three pixels next to one another are
shared uint blocks[most_rows];      // which columns have 3 x 3 bare pixels in the row within reach

uvec2 left_by(uvec2 bits, uint count) { return uvec2(bits.x << count, bits.y << count | bits.x >> 32u - count); }
uvec2 right_by(uvec2 bits, uint count) { return uvec2(bits.x >> count | bits.y << 32u - count, bits.y >> count); }

uint word_at(int y, int column) {
  bool inside = y >= 0 && column >= 0 && y < int(push.height) && column < int(gl_NumWorkGroups.x);
  return inside ? push.bare.at[(gl_WorkGroupID.z * push.height + uint(y)) * gl_NumWorkGroups.x + uint(column)] : 0u;
}

void main() {
  uint reach = push.bare_reach, rows = group + 2u * reach, row = gl_LocalInvocationIndex;
  if (row < rows + 2u) {
    int y = int(gl_WorkGroupID.y * group + row) - int(reach) - 1, column = int(gl_WorkGroupID.x);
    uint own = word_at(y, column);
    uvec2 bits = uvec2(word_at(y, column - 2) >> 8u | word_at(y, column - 1) << 8u | own << 24u,
                       own >> 8u | word_at(y, column + 1) << 8u | word_at(y, column + 2) << 24u);
    bare[row] = bits & left_by(bits, 1u) & right_by(bits, 1u);
  }
  barrier();
  if (row < rows) {
    uvec2 all = bare[row] & bare[row + 1u] & bare[row + 2u], near = all;
    for (uint k = 1u; k <= reach; ++k) near |= left_by(all, k) | right_by(all, k);
    blocks[row] = near.x >> 24u | near.y << 8u;
  }
  barrier();
  uint found = 0u;
  for (uint k = 0u; k <= 2u * reach; ++k) found |= blocks[gl_LocalInvocationID.y + k];
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if ((found >> gl_LocalInvocationID.x & 1u) == 0u || pixel.x >= int(push.width) || pixel.y >= int(push.height)) return;
  uint at = (gl_WorkGroupID.z * push.height + uint(pixel.y)) * push.width + uint(pixel.x);
  if (push.disparity.at[at] == push.invalid) return;
  push.disparity.at[at] = push.invalid;
  if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[at] = 0.0f;
  if ((push.maps & MAPS_REASON) != 0u) push.reason.at[at] = uint8_t(REASON_LOW_TEXTURE);
}
