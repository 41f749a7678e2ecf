// SPDX-License-Identifier: Apache-2.0
// The dynamic programme of one path, SGM's L_r (Hirschmüller 2008, eq. 13), as exact integers in 16-bit halves. With HALF_MIN the integers
// are biased so that they are the bits of normal, positive half floats, whose order is that of the integers: one packed minimum serves two
// disparities. Without it the order of the steps is another, so that no sum leaves 16 bits: costs and penalties may then fill them.
#ifndef SIMSENSE_PATH_STATE_GLSL
#define SIMSENSE_PATH_STATE_GLSL
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_shuffle_relative : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "lib/lanes.glsl"

layout(push_constant, scalar) uniform Push { PathPush push; };

uint both(uint value) { return value * 0x10001u; }

#ifdef HALF_MIN
#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require
const uint bias = 0x0400u;  // smallest normal half
uint min_pairs(uint a, uint b) { return packFloat2x16(min(unpackFloat2x16(a), unpackFloat2x16(b))); }
uint no_path() { return 0x7bffu - push.p1; }  // largest finite half, with room for a penalty
#else
const uint bias = 0u;
uint min_pairs(uint a, uint b) { return min(a & 0xffffu, b & 0xffffu) | min(a >> 16, b >> 16) << 16; }
uint no_path() { return 0xffffu; }
#endif

uint path[lane_pairs];      // biased L_r of the pixel last visited
uint lowest;                // its minimum over all disparities, in both halves
uint step_cost[lane_pairs];  // of the pixel to visit
uint jump_penalty;           // p2 between the pixel last visited and the one to visit
uint beyond[lane_pairs];    // all ones where a half is beyond the last disparity

/// L_r = 0 before the first pixel makes L_r = C there.
void restart_path(bool restart) {
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) path[k] = restart ? both(bias) : path[k];
  lowest = restart ? both(bias) : lowest;
}

void begin_path(bool mirrored) {
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) {
    uint first = lane() * lane_disparities + k, second = first + lane_pairs, last = padded_disparities - 1u;
    uvec2 d = mirrored ? uvec2(last - first, last - second) : uvec2(first, second);
    beyond[k] = (d.x >= disparities ? 0xffffu : 0u) | (d.y >= disparities ? 0xffff0000u : 0u);
  }
  restart_path(true);
  jump_penalty = push.p2;
}

uint cluster_min(uint value) {
  if (path_lanes == subgroup_lanes) return subgroupMin(value);
  [[unroll]] for (uint mask = 1u; mask < path_lanes; mask <<= 1) value = min(value, subgroupShuffleXor(value, mask));
  return value;
}

void find_lowest() {
  uint least = path[0];
  [[unroll]] for (uint k = 1u; k < lane_pairs; ++k) least = min_pairs(least, path[k]);
  lowest = both(cluster_min(min(least & 0xffffu, least >> 16)));
}

/// L_r from the neighbouring disparities' minimum, the same disparity's and the overall one plus `jump`; and the cost.
uint next_path(uint neighbours, uint here, uint cost, uint jump) {
#ifdef HALF_MIN
  uint least = min_pairs(min_pairs(neighbours + both(push.p1), here), lowest + both(jump));
#else
  uint least = min_pairs(here, min_pairs(neighbours, lowest + both(jump - push.p1)) + both(push.p1));
#endif
  return least + cost + both(bias) - lowest;
}

/// One pixel further along the path, or its first pixel: there a free jump makes L_r = C, whatever was before.
void step_path(bool begins) {
#ifdef HALF_MIN
  uint jump = begins ? 0u : jump_penalty;
#else
  uint jump = jump_penalty;
  restart_path(begins);
#endif
  uint before = subgroupShuffleUp(path[lane_pairs - 1u], 1u), after = subgroupShuffleDown(path[0], 1u);
  if (lane() == 0u) before = both(no_path());
  if (lane() == path_lanes - 1u) after = both(no_path());
  uint below = before >> 16 | path[lane_pairs - 1u] << 16;
  uint top = path[0] >> 16 | after << 16;
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) {
    uint here = path[k], above = k + 1u < lane_pairs ? path[k + 1u] : top;
    path[k] = next_path(min_pairs(below, above), here, step_cost[k], jump);
    if (padded_disparities != disparities) path[k] = (path[k] & ~beyond[k]) | (both(no_path()) & beyond[k]);
    below = here;
  }
  find_lowest();
}

/// The low bytes of the halves of two pairs.
uint low_bytes(uint even, uint odd) { return (even & 0x00ff00ffu) | (odd << 8 & 0xff00ff00u); }

/// Word w of this lane's path costs in a volume.
uint path_word(uint w) {
  if (sum_bytes == 1u) return low_bytes(path[2u * w], path[2u * w + 1u]);
  if (sum_bytes == 2u) return path[w] - both(bias);
  return (path[w / 2u] - both(bias)) >> (16u * (w & 1u)) & 0xffffu;
}

/// The same with its elements in reverse order.
uint mirrored_word(uint w) {
  if (sum_bytes == 4u) return path_word(w);
  uint word = sum_bytes == 1u ? low_bytes(path[2u * w + 1u], path[2u * w]) : path_word(w);
  return word << 16 | word >> 16;
}
#endif
