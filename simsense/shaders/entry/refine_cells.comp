// SPDX-License-Identifier: Apache-2.0
// First pass of the refinement (match/refine.h): figures of each cell, of every second row. A workgroup is a cell.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/evidence.glsl"

layout(local_size_x = 16, local_size_y = 8) in;

shared int sums[10];

void main() {
  if (gl_LocalInvocationIndex < 10u) sums[gl_LocalInvocationIndex] = 0;
  barrier();
  uvec2 pixel = gl_WorkGroupID.xy * cell_side + uvec2(gl_LocalInvocationID.x, 2u * gl_LocalInvocationID.y);
  if (pixel.x < push.width && pixel.y < push.height) {
    Evidence one = look(int(pixel.x), int(pixel.y), vec2(0.0f));
    int shape = pull_at(one.q), slope = one.slope * shape + 4 >> 3, match_slope = one.match_slope * shape + 4 >> 3;
    atomicAdd(sums[0], one.slope);
    atomicAdd(sums[1], one.match_slope);
    atomicAdd(sums[2], one.difference);
    atomicAdd(sums[3], one.slope * one.difference);
    atomicAdd(sums[4], one.slope * one.match_slope);
    atomicAdd(sums[5], slope);
    atomicAdd(sums[6], match_slope);
    atomicAdd(sums[7], slope * one.difference);
    atomicAdd(sums[8], slope * one.match_slope);
    atomicAdd(sums[9], slope * match_slope);
  }
  barrier();
  if (gl_LocalInvocationIndex > 0u) return;
  uint cell = REFINE_CELL_FIGURES * (first_cell() + gl_WorkGroupID.y * cell_columns() + gl_WorkGroupID.x);
  push.cells.at[cell] = less_constant(sums[3], sums[0], sums[2], REFINE_CELL_SHARE);
  push.cells.at[cell + 1u] = max(less_constant(sums[4], sums[0], sums[1], REFINE_CELL_SHARE), 0.0f);
  push.cells.at[cell + 2u] = less_constant(sums[7], sums[5], sums[2], REFINE_CELL_SHARE);
  push.cells.at[cell + 3u] = less_constant(sums[8], sums[5], sums[1], REFINE_CELL_SHARE);
  push.cells.at[cell + 4u] = max(less_constant(sums[9], sums[5], sums[6], REFINE_CELL_SHARE), 0.0f);
}
