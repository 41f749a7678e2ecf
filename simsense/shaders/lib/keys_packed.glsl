// SPDX-License-Identifier: Apache-2.0
// Mean costs of a pixel's disparities, each with its disparity in 16 bits, two in a word: mean << 8 | disparity plus a bias that makes them
// normal, positive half floats, whose order is that of the integers. For means below 119 and at most 256 disparities (src/vulkan/plan.cpp).
#ifndef SIMSENSE_KEYS_PACKED_GLSL
#define SIMSENSE_KEYS_PACKED_GLSL
#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require

const uint key_bias = 0x0400u, no_key = 0x7bffu;  // smallest normal and largest finite half
const uint most_mean = 119u;                      // above all that there are

const uint all_disparities = lane_disparities < 32u ? (1u << (lane_disparities & 31u)) - 1u : 0xffffffffu;
uint keys[lane_pairs];  // as the lane's words of path costs: disparities k and k + lane_pairs
uint right_keys[lane_pairs];

uint both(uint value) { return value * 0x10001u; }
uint min_pairs(uint a, uint b) { return packFloat2x16(min(unpackFloat2x16(a), unpackFloat2x16(b))); }
uint mean_of(uint key) { return (key - key_bias) >> 8; }
uint disparity_of(uint key) { return key & 0xffu; }

void make_keys(uint slot) {
  uint lane_start = lane() * lane_disparities, first = both(key_bias + lane_start) + (lane_pairs << 16);
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) {
    keys[k] = (narrow_sum(slot, k) << (8u - mean_shift) & 0xff00ff00u) + (first + both(k));
    if (padded_disparities == disparities) continue;
    if (lane_start + k >= disparities) keys[k] = (keys[k] & 0xffff0000u) | no_key;
    if (lane_start + k + lane_pairs >= disparities) keys[k] = (keys[k] & 0xffffu) | no_key << 16;
  }
}

/// Least mean of all disparities, and the least disparity that has it.
uvec2 least_mean() {
  uint best = keys[0];
  [[unroll]] for (uint k = 1u; k < lane_pairs; ++k) best = min_pairs(best, keys[k]);
  best = cluster_min(min(best & 0xffffu, best >> 16));
  return uvec2(mean_of(best), disparity_of(best));
}

/// relative: see left_winner().
uint least_mean_elsewhere(uint relative) {
  uint least = no_key;
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) {
    least = relative + k > 2u ? min(least, keys[k] & 0xffffu) : least;
    least = relative + k + lane_pairs > 2u ? min(least, keys[k] >> 16) : least;
  }
  return mean_of(cluster_min(least));
}

/// Whether one of the lane's disparities away from the winner has a mean below the limit.
bool has_rival(uint limit, uint relative) {
  uint up = both(0x8000u - (key_bias + (min(limit, most_mean) << 8))), reached = 0u;  // keys that reach the limit get their highest bit
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) reached = reached >> 1 | ((keys[k] + up) & 0x80008000u);
  uint in_order = (reached >> (16u - lane_pairs) & ((1u << lane_pairs) - 1u)) | reached >> (32u - lane_pairs) << lane_pairs;
  int first = -int(relative);  // winner - 1, as seen from the lane's first disparity
  uint near = first >= 0 ? (first < 32 ? 7u << first : 0u) : (first > -3 ? 7u >> -first : 0u);
  return ((in_order | near) & all_disparities) != all_disparities;
}

void begin_right() {
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) right_keys[k] = both(no_key);
}

void offer_key(int column, uint key) {
  if (key != no_key) offer_right(column, mean_of(key), disparity_of(key));
}

void right_step(uint x) {
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) right_keys[k] = min_pairs(right_keys[k], keys[k]);
  uint last = right_keys[lane_pairs - 1u], entering = subgroupShuffleUp(last, 1u) >> 16;
  if (lane() == path_lanes - 1u) offer_key(int(x) - int(padded_disparities - 1u), last >> 16);
  [[unroll]] for (uint k = lane_pairs - 1u; k > 0u; --k) right_keys[k] = right_keys[k - 1u];
  right_keys[0] = last << 16 | (lane() == 0u ? no_key : entering);
}

/// Writes the rest when the sweep ends before x.
void flush_right(uint x) {
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) {
    int column = int(x) - int(lane() * lane_disparities + k);
    offer_key(column, right_keys[k] & 0xffffu);
    offer_key(column - int(lane_pairs), right_keys[k] >> 16);
  }
}
#endif
