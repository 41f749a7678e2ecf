// SPDX-License-Identifier: Apache-2.0
// Resampling through a table of source coordinates, the arithmetic of cpu/rectify/remap.cpp.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/image.glsl"
#include "shared/remap_push.h"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { RemapPush push; };

float tap(uint n, float x, float y) {
  if (x < 0.0f || y < 0.0f || x > float(push.width - 1u) || y > float(push.height - 1u)) return 0.0f;
  return load_element(push.source, element_of(push.source, n, uint(x), uint(y)));
}

float bilinear(uint n, float sx, float sy) {
  if (!(sx > -1.0f && sy > -1.0f && sx < float(push.width) && sy < float(push.height))) return 0.0f;
  float x0 = floor(sx), y0 = floor(sy);
  precise float fx = sx - x0, fy = sy - y0;
  precise float top = (1.0f - fx) * tap(n, x0, y0) + fx * tap(n, x0 + 1.0f, y0);
  precise float bottom = (1.0f - fx) * tap(n, x0, y0 + 1.0f) + fx * tap(n, x0 + 1.0f, y0 + 1.0f);
  precise float value = (1.0f - fy) * top + fy * bottom;
  return value;
}

/// Halves away from zero, inside the source.
float nearest_column(float s, uint size) {
  s = clamp(s, 0.0f, float(size - 1u));
  float whole = floor(s);
  return min(s - whole >= 0.5f ? whole + 1.0f : whole, float(size - 1u));
}

void main() {
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  if (x >= push.width || y >= push.height) return;
  float sx = push.x.at[y * push.width + x], sy = push.y.at[y * push.width + x];
  float value = push.nearest != 0u ? tap(n, nearest_column(sx, push.width), nearest_column(sy, push.height)) : bilinear(n, sx, sy);
  uint counts = uint(roundEven(value));
  if (push.target.format != 0u) store_counts(push.target, element_of(push.target, n, x, y), counts);
  if (push.copy.format != 0u) store_counts(push.copy, element_of(push.copy, n, x, y), counts);
}
