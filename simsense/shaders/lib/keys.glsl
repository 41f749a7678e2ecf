// SPDX-License-Identifier: Apache-2.0
// Mean costs of a pixel's disparities, each with its disparity in 32 bits: any range.
#ifndef SIMSENSE_KEYS_GLSL
#define SIMSENSE_KEYS_GLSL

const uint no_key = 0xffffffffu;

uint keys[lane_disparities];  // mean cost << 16 | disparity
uint right_keys[lane_disparities];

/// Mean of the paths at the lane's disparities k and k + lane_pairs, as a pair.
uint mean_pair(uint slot, uint k) {
  if (sum_bytes == 1u) return narrow_sum(slot, k) >> mean_shift & 0x00ff00ffu;
  uint low = 0u, high = 0u;
  [[unroll]] for (uint v = 0u; v < volumes; ++v) {
    uint first = v * volume_words + slot * lane_words;
    low += sum_bytes == 2u ? sums[first + k] & 0xffffu : sums[first + 2u * k];
    high += sum_bytes == 2u ? sums[first + k] >> 16 : sums[first + 2u * k + 1u];
  }
  return low >> mean_shift | high >> mean_shift << 16;
}

void make_keys(uint slot) {
  uint lane_start = lane() * lane_disparities;
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) {
    uint mean = mean_pair(slot, k);
    keys[k] = mean << 16 | (lane_start + k);
    keys[k + lane_pairs] = (mean & 0xffff0000u) | (lane_start + k + lane_pairs);
  }
  if (padded_disparities == disparities) return;
  [[unroll]] for (uint k = 0u; k < lane_disparities; ++k)
    if (lane_start + k >= disparities) keys[k] = no_key;
}

/// Least mean of all disparities, and the least disparity that has it.
uvec2 least_mean() {
  uint best = keys[0];
  [[unroll]] for (uint k = 1u; k < lane_disparities; ++k) best = min(best, keys[k]);
  best = cluster_min(best);
  return uvec2(best >> 16, best & 0xffffu);
}

/// relative: see left_winner().
uint least_mean_elsewhere(uint relative) {
  uint least = no_key;
  [[unroll]] for (uint k = 0u; k < lane_disparities; ++k) least = relative + k > 2u ? min(least, keys[k]) : least;
  return cluster_min(least) >> 16;
}

/// Whether one of the lane's disparities away from the winner has a mean below the limit.
bool has_rival(uint limit, uint relative) {
  bool rival = false;
  [[unroll]] for (uint k = 0u; k < lane_disparities; ++k) rival = rival || (keys[k] < limit << 16 && relative + k > 2u);
  return rival;
}

void begin_right() {
  [[unroll]] for (uint k = 0u; k < lane_disparities; ++k) right_keys[k] = no_key;
}

void right_step(uint x) {
  [[unroll]] for (uint k = 0u; k < lane_disparities; ++k) right_keys[k] = min(right_keys[k], keys[k]);
  uint leaving = right_keys[lane_disparities - 1u], entering = subgroupShuffleUp(leaving, 1u);
  if (lane() == path_lanes - 1u && leaving != no_key) offer_right(int(x) - int(padded_disparities - 1u), leaving >> 16, leaving & 0xffffu);
  [[unroll]] for (uint k = lane_disparities - 1u; k > 0u; --k) right_keys[k] = right_keys[k - 1u];
  right_keys[0] = lane() == 0u ? no_key : entering;
}

/// Writes the rest when the sweep ends before x.
void flush_right(uint x) {
  [[unroll]] for (uint k = 0u; k < lane_disparities; ++k)
    if (right_keys[k] != no_key) offer_right(int(x) - int(lane() * lane_disparities + k), right_keys[k] >> 16, right_keys[k] & 0xffffu);
}
#endif
