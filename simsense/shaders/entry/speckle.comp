// SPDX-License-Identifier: Apache-2.0
// The other passes of the speckle filter: islands join over the borders of tiles, the sizes of their parts add up, and small ones drop.
#version 460
#extension GL_GOOGLE_include_directive : require
#define DISPARITY(i) push.disparity.at[i]
#define PARENT(i) push.parent.at[i]
#include "lib/islands.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

void main() {
  uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y;
  if (x >= push.width || y >= push.height) return;
  uint pixel = (gl_WorkGroupID.z * push.height + y) * push.width + x;
  if (push.step == SPECKLE_JOIN) {
    uint column = x % SPECKLE_TILE, row = y % SPECKLE_TILE;
    if (column == 0u && x > 0u) join_over(pixel, 1u, push.width, row > 0u);
    if (row == 0u && y > 0u) join_over(pixel, push.width, 1u, column > 0u);
  } else if (push.step == SPECKLE_COUNT) {
    uint size = push.size.at[pixel];
    if (size == 0u || push.parent.at[pixel] == pixel) return;
    uint island = root(pixel);
    atomicAdd(push.size.at[island], size);
    push.parent.at[pixel] = island;
  } else if (push.disparity.at[pixel] != push.invalid && push.size.at[root(pixel)] <= push.max_size) {
    drop(pixel, REASON_SPECKLE);
  }
}
