// SPDX-License-Identifier: Apache-2.0
// From one image to another: counts of any width, or floats.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/image.glsl"
#include "shared/remap_push.h"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { CopyPush push; };

void main() {
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (x >= push.width || y >= push.height) return;
  float value = load_element(push.source, element_of(push.source, n, x, y));
  uint to = element_of(push.target, n, x, y), bits = push.extra_bits, count = uint(value);
  if (bits == 0u) {
    store_element(push.target, to, value);
  } else {  // image_count() of signal/imager.h
    store_counts(push.target, to, min(count + ((1u << bits) - 1u) / 2u + (count >> bits & 1u) >> bits, 255u));
  }
}
