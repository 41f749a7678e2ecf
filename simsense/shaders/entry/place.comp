// SPDX-License-Identifier: Apache-2.0
// The maps of a region of interest in those of the whole image.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared/map_push.h"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { PlacePush push; };

void main() {
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (x >= push.width || y >= push.height) return;
  bool inside = x >= push.x0 && x < push.x1 && y >= push.y0 && y < push.y1;
  uint to = (n * push.height + y) * push.width + x;
  uint from = (n * push.part_height + y - push.part_y) * push.part_width + x - push.part_x;
  push.disparity.at[to] = inside ? push.part_disparity.at[from] : push.invalid;
  if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[to] = inside ? push.part_confidence.at[from] : 0.0f;
  if ((push.maps & MAPS_REASON) != 0u) push.reason.at[to] = inside ? push.part_reason.at[from] : uint8_t(REASON_NOT_COMPUTED);
}
