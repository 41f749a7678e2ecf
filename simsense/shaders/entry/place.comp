// The maps of a region of interest in those of the whole image.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared/map_push.h"

const uint has_confidence = 1u, has_reason = 2u;  // MATCH_*
const uint reason_not_computed = 7u;              // SIMSENSE_REASON_NOT_COMPUTED

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { PlacePush push; };

void main() {
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (x >= push.width || y >= push.height) return;
  bool inside = x >= push.x0 && x < push.x1 && y >= push.y0 && y < push.y1;
  uint to = (n * push.height + y) * push.width + x;
  uint from = (n * push.part_height + y - push.part_y) * push.part_width + x - push.part_x;
  push.disparity.at[to] = inside ? push.part_disparity.at[from] : push.invalid;
  if ((push.maps & has_confidence) != 0u) push.confidence.at[to] = inside ? push.part_confidence.at[from] : 0.0f;
  if ((push.maps & has_reason) != 0u) push.reason.at[to] = inside ? push.part_reason.at[from] : uint8_t(reason_not_computed);
}
