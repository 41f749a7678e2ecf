// SPDX-License-Identifier: Apache-2.0
// Standard normals shaped by a Gaussian PSF (signal/imager.h): first along the rows, of white ones drawn into shared memory, then along the
// columns.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/signal/math.glsl"
#include "lib/signal/random.glsl"
#include "shared/signal_push.h"

const uint tile = 256u, most_reach = 64u;
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SignalPush push; };
shared float white[tile + 2u * most_reach];

/// Row `row` of along_rows stands for the image's row - radius.
void shape_rows(SignalParameters p, uint part, uint row) {
  uint n = gl_WorkGroupID.z, tile_x = gl_WorkGroupID.x * tile, reach = (p.grain_radius + 3u) / 4u * 4u;
  uvec2 key = part == 0u ? push.block.head.keys[n].scene : push.block.head.keys[n].frame;
  int first_quad = (int(tile_x) - int(reach)) / 4;
  for (uint q = gl_LocalInvocationID.x; q < (tile + 2u * reach) / 4u; q += gl_WorkGroupSize.x) {
    vec4 normals = normals_of(quad_words(key, DIMENSION_SPECKLE_STATIC + part, uint(first_quad + int(q)), row - p.grain_radius));
    [[unroll]] for (uint i = 0u; i < 4u; ++i) white[4u * q + i] = normals[i];
  }
  barrier();
  uint rows = p.height + 2u * p.grain_radius;
  for (uint i = gl_LocalInvocationID.x; i < min(tile, p.pitch - tile_x); i += gl_WorkGroupSize.x) {
    float sum = 0.0f;
    for (uint k = 0u; k <= 2u * p.grain_radius; ++k) sum += white[reach - p.grain_radius + i + k] * push.block.tables.grain_weights[k];
    p.along_rows.at[(n * rows + row) * p.pitch + tile_x + i] = sum;
  }
}

void shape_columns(SignalParameters p, uint part, uint y) {
  uint n = gl_WorkGroupID.z, tile_x = gl_WorkGroupID.x * tile, rows = p.height + 2u * p.grain_radius;
  for (uint i = gl_LocalInvocationID.x; i < min(tile, p.pitch - tile_x); i += gl_WorkGroupSize.x) {
    float sum = 0.0f;
    for (uint k = 0u; k <= 2u * p.grain_radius; ++k)
      sum += p.along_rows.at[(n * rows + y + k) * p.pitch + tile_x + i] * push.block.tables.grain_weights[k];
    p.normals[part].at[(n * p.height + y) * p.pitch + tile_x + i] = sum;
  }
}

void main() {
  SignalParameters p = push.block.head.parameters;
  if (push.columns == 0u) {
    shape_rows(p, push.passes, gl_WorkGroupID.y);
  } else {
    shape_columns(p, push.passes, gl_WorkGroupID.y);
  }
}
