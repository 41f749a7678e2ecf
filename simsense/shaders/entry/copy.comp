// Counts from one image to others of any format.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/image.glsl"
#include "shared/remap_push.h"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { RemapPush push; };

void main() {
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (x >= push.width || y >= push.height) return;
  uint counts = uint(load_element(push.source, element_of(push.source, n, x, y)));
  if (push.target.format != 0u) store_counts(push.target, element_of(push.target, n, x, y), counts);
  if (push.copy.format != 0u) store_counts(push.copy, element_of(push.copy, n, x, y), counts);
}
