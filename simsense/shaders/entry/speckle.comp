// SPDX-License-Identifier: Apache-2.0
// Speckle filter (cpu/checks/speckle.h) by a union-find that all pixels build at once: parents only ever move to smaller pixels of the same
// island (Playne and Hawick, A new algorithm for parallel connected-component labelling on GPUs, IEEE TPDS 29(6), 2018), so that the islands
// do not depend on the order. Four passes: begin, join, count, drop.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "lib/clean.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

uint root(uint pixel) {
  for (uint next = push.parent.at[pixel]; next != pixel; next = push.parent.at[pixel]) pixel = next;
  return pixel;
}

void join(uint a, uint b) {
  for (;;) {
    a = root(a), b = root(b);
    if (a == b) return;
    uint high = max(a, b), low = min(a, b), before = atomicMin(push.parent.at[high], low);
    if (before == high) return;
    a = low, b = before;  // another pixel moved it meanwhile: its parent belongs here too
  }
}

/// Neighbours mostly lie on one island: they are counted at once, so that not all pixels of an image wait for one word.
void count_pixel(uint island) {
  if (!subgroupAllEqual(island)) {
    atomicAdd(push.size.at[island], 1u);
    return;
  }
  uint pixels = subgroupBallotBitCount(subgroupBallot(true));
  if (subgroupElect()) atomicAdd(push.size.at[island], pixels);
}

bool connected(uint a, uint b) {
  float da = push.disparity.at[a], db = push.disparity.at[b];
  return da != push.invalid && db != push.invalid && abs(da - db) <= push.max_diff_px;
}

void main() {
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y;
  if (x >= push.width || y >= push.height) return;
  uint pixel = (gl_WorkGroupID.z * push.height + y) * push.width + x;
  if (push.step == SPECKLE_BEGIN) {
    push.parent.at[pixel] = pixel;
    push.size.at[pixel] = 0u;
  } else if (push.step == SPECKLE_JOIN) {
    if (x > 0u && connected(pixel, pixel - 1u)) join(pixel, pixel - 1u);
    if (y > 0u && connected(pixel, pixel - push.width)) join(pixel, pixel - push.width);
  } else if (push.step == SPECKLE_COUNT) {
    count_pixel(root(pixel));
  } else if (push.disparity.at[pixel] != push.invalid && push.size.at[root(pixel)] <= push.max_size) {
    drop(pixel, REASON_SPECKLE);
  }
}
