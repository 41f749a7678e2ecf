// SPDX-License-Identifier: Apache-2.0
// First pass of the speckle filter: the islands within a tile, in shared memory. A pixel's parent becomes the first pixel of its part of an
// island, which gets that part's size.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "shared/clean_push.h"

const uint tile = SPECKLE_TILE, pixels = tile * tile, group_rows = 8u, step = tile * group_rows;
layout(local_size_x = tile, local_size_y = group_rows) in;
shared float disparities[pixels];
shared uint parents[pixels], sizes[pixels];
#define DISPARITY(i) disparities[i]
#define PARENT(i) parents[i]
#include "lib/islands.glsl"

uint pixel_at(uint i) {
  uvec2 pixel = gl_WorkGroupID.xy * tile + uvec2(i % tile, i / tile);
  return (gl_WorkGroupID.z * push.height + pixel.y) * push.width + pixel.x;
}

bool is_inside(uint i) {
  uvec2 pixel = gl_WorkGroupID.xy * tile + uvec2(i % tile, i / tile);
  return pixel.x < push.width && pixel.y < push.height;
}

/// Neighbours mostly lie on one island: they are counted at once.
void count_pixel(uint island) {
  if (!subgroupAllEqual(island)) {
    atomicAdd(sizes[island], 1u);
    return;
  }
  uint count = subgroupBallotBitCount(subgroupBallot(true));
  if (subgroupElect()) atomicAdd(sizes[island], count);
}

void main() {
  uint first = gl_LocalInvocationIndex, x = gl_LocalInvocationID.x;
  for (uint i = first; i < pixels; i += step) {
    disparities[i] = is_inside(i) ? push.disparity.at[pixel_at(i)] : push.invalid;
    sizes[i] = 0u;
  }
  barrier();
  for (uint i = first; i < pixels; i += step) parents[i] = x > 0u && connected(i, i - 1u) ? i - 1u : i;
  for (uint reach = 1u; reach < tile; reach *= 2u) {  // to the first of the connected pixels along the row
    barrier();
    for (uint i = first; i < pixels; i += step) parents[i] = parents[parents[i]];
  }
  barrier();
  for (uint i = first; i < pixels; i += step)
    if (i >= tile) join_over(i, tile, 1u, x > 0u);
  barrier();
  for (uint i = first; i < pixels; i += step)
    if (disparities[i] != push.invalid) count_pixel(root(i));
  barrier();
  for (uint i = first; i < pixels; i += step) {
    if (!is_inside(i)) continue;
    push.parent.at[pixel_at(i)] = pixel_at(root(i));
    push.size.at[pixel_at(i)] = sizes[i];
  }
}
