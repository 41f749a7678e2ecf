// SPDX-License-Identifier: Apache-2.0
// Winners of the left and the right image from the paths' mean, uniqueness and the subpixel step. A cluster sweeps a part of a row; the
// right image's candidates travel with it: pixel x's disparity d concerns the right pixel x - d, as does disparity d + 1 of the next pixel,
// so the best so far moves one disparity on per pixel and leaves behind the last one.
// Compiled twice: with PACKED_KEYS means and disparities fit 16 bits together, where the device has half floats; else any range.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_shuffle_relative : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_vote : require
#include "lib/exact_ratio.glsl"
#include "lib/lanes.glsl"

layout(push_constant, scalar) uniform Push { WinnerPush push; };
layout(constant_id = 11) const uint segments = 1u;  // parts of a row that are swept side by side
layout(constant_id = 12) const uint volumes = 2u;   // of path costs

const uint mean_shift = path_count == 8u ? 3u : 2u, volume_words = steps * lane_words;
uint sums[volumes * volume_words], next_sums[volumes * volume_words];  // of the pixels of this block of steps and of the next one
uint width, pixel_row;  // first pixel of the row

/// All pixels of a block at once: a load at every step would have the step's shuffles wait for it.
void look_ahead(uint x) {
  [[unroll]] for (uint s = 0u; s < steps; ++s) {
    uint item = (pixel_row + min(x + s, width - 1u)) * path_lanes + lane();
    [[unroll]] for (uint v = 0u; v < volumes; ++v) {
      LOAD_WORDS(next_sums, v * volume_words + s * lane_words, lane_words, push.sums[v], item)
    }
  }
}

void take_next() {
  [[unroll]] for (uint i = 0u; i < volumes * volume_words; ++i) sums[i] = next_sums[i];
}

/// Sum of the paths at the lane's disparities k and k + lane_pairs, as a pair; halves do not overflow where elements have one byte.
uint narrow_sum(uint slot, uint k) {
  uint sum = 0u;
  [[unroll]] for (uint v = 0u; v < volumes; ++v) sum += sums[v * volume_words + slot * lane_words + k / 2u] >> (8u * (k & 1u)) & 0x00ff00ffu;
  return sum;
}

uint cluster_min(uint value) {
  if (path_lanes == subgroup_lanes) return subgroupMin(value);
  [[unroll]] for (uint mask = 1u; mask < path_lanes; mask <<= 1) value = min(value, subgroupShuffleXor(value, mask));
  return value;
}

bool cluster_any(bool value) {
  if (path_lanes == subgroup_lanes) return subgroupAny(value);
  uvec4 votes = subgroupBallot(value);
  uint own = gl_SubgroupInvocationID & ~(path_lanes - 1u);
  return ((own < 32u ? votes.x : votes.y) >> (own & 31u) & (0xffffffffu >> (32u - path_lanes))) != 0u;
}

void offer_right(int column, uint mean, uint disparity) {
  int right_x = column - push.min_disparity;
  if (right_x >= 0 && right_x < int(width)) atomicMin(push.right_winner.at[pixel_row + uint(right_x)], mean << 16 | disparity);
}

#ifdef PACKED_KEYS
#include "lib/keys_packed.glsl"
#else
#include "lib/keys.glsl"
#endif

/// Least mean cost that a disparity away from the winner may have: cost * (100 - ratio) >= winner's cost * 100.
uint least_other(uint winner_cost) {
  if (uniqueness_ratio >= 100u) return winner_cost > 0u ? 0xffffu : 0u;
  uint share = 100u - uniqueness_ratio;
  return min((winner_cost * 100u + share - 1u) / share, 0xffffu);
}

/// 1 - lowest cost / lowest cost of a disparity that is no neighbour of the winner.
float sureness(uint lowest, uint relative) {
  uint second = least_mean_elsewhere(relative);
  if (second == 0u) return 0.0f;
  return lowest == second ? 0.0f : 1.0f - exact_ratio(lowest, second);
}

/// Winning disparity, or -1 where it is not unique; how sure, if wanted.
int left_winner(out float sure) {
  uvec2 best = least_mean();
  uint relative = lane() * lane_disparities - best.y + 1u;  // |d - winner| <= 1 exactly if relative + k <= 2
  sure = (push.maps & MAPS_CONFIDENCE) != 0u ? sureness(best.x, relative) : 0.0f;
  return cluster_any(has_rival(least_other(best.x), relative)) ? -1 : int(best.y);
}

/// Word and bit position of disparity d among a pixel's words of `bytes` per element.
uvec2 element_place(uint d, uint bytes) {
  uint block = d / lane_disparities, k = d % lane_disparities, pair = k % lane_pairs, high = k / lane_pairs;
  uint first = block * (lane_disparities * bytes / 4u);
  if (bytes == 4u) return uvec2(first + 2u * pair + high, 0u);
  if (bytes == 2u) return uvec2(first + pair, 16u * high);
  return uvec2(first + pair / 2u, 8u * (pair & 1u) + 16u * high);
}

int mean_cost(uint x, uint d) {
  uvec2 place = element_place(d, sum_bytes);
  uint at = (pixel_row + x) * (path_lanes * lane_words) + place.x, mask = sum_bytes == 1u ? 0xffu : sum_bytes == 2u ? 0xffffu : 0xffffffffu;
  uint sum = 0u;
  [[unroll]] for (uint v = 0u; v < volumes; ++v) sum += push.sums[v].at[at] >> place.y & mask;
  return int(sum >> mean_shift);
}

int stored_block_cost(uint x, uint d) {
  uvec2 place = element_place(d, 2u);
  return int(push.cost.at[(pixel_row + x) * (padded_disparities / 2u) + place.x] >> place.y & 0xffffu);
}

/// Block costs at winner - 1, winner, winner + 1, from census words.
ivec3 summed_block_costs(uint x, uint winner) {
  uint pair = gl_WorkGroupID.z * push.height;
  int row = int(pixel_row / width - pair);
  ivec3 sum = ivec3(0);
  for (int j = -int(block_height / 2u); j <= int(block_height / 2u); ++j) {
    uint y = pair + uint(clamp(row + j, 0, int(push.height) - 1));
    for (int i = -int(block_width / 2u); i <= int(block_width / 2u); ++i) {
      uint column = uint(clamp(int(x) + i, 0, int(width) - 1)), right = y * push.right_pitch + push.right_origin + column - winner;
      uint left = push.left_census.at[y * width + column + left_margin];
      sum += ivec3(bitCount(left ^ push.right_census.at[right + 1u]), bitCount(left ^ push.right_census.at[right]),
                   bitCount(left ^ push.right_census.at[right - 1u]));
    }
  }
  return sum;
}

/// Costs at winner - 1, winner, winner + 1 that the subpixel step looks at.
ivec3 costs_around(uint x, uint winner) {
  if (subpixel == SUBPIXEL_EQUIANGULAR && block_pixels > 1u) {
    ivec3 c = stored_costs ? ivec3(stored_block_cost(x, winner - 1u), stored_block_cost(x, winner), stored_block_cost(x, winner + 1u))
                           : summed_block_costs(x, winner);
    if (c.y <= c.x && c.y <= c.z) return c;
  }
  return ivec3(mean_cost(x, winner - 1u), mean_cost(x, winner), mean_cost(x, winner + 1u));
}

float disparity_at(uint x, int winner) {
  if (winner < 0) return -1.0f;
  if (subpixel == SUBPIXEL_NONE || winner == 0 || winner + 1 == int(disparities)) return float(winner);
  ivec3 c = costs_around(x, uint(winner));
  int fall = c.x - c.z;  // towards winner + 1
  int depth = subpixel == SUBPIXEL_PARABOLA ? c.x - 2 * c.y + c.z : max(c.x, c.z) - c.y;
  if (depth == 0) return float(winner);
  float offset = exact_ratio(uint(abs(fall)), uint(2 * depth));
  return float(winner) + (fall < 0 ? -offset : offset);
}

void main() {
  width = push.width;
  uint row = gl_WorkGroupID.x * cluster_count() + cluster();
  bool valid = row < push.height;
  pixel_row = (gl_WorkGroupID.z * push.height + min(row, push.height - 1u)) * width;
  // The same for the whole workgroup: shuffles in code that may diverge are several times as long on NVIDIA.
  uint segment = gl_WorkGroupID.y, begin = segment * width / segments, end = (segment + 1u) * width / segments;
  begin_right();
  look_ahead(begin);
  [[dont_unroll]] for (uint first = begin; first < end; first += path_lanes) {
    int own_winner = -1;
    float own_sureness = 0.0f;
    [[dont_unroll]] for (uint part = 0u; part < path_lanes; part += steps) {
      take_next();
      look_ahead(first + part + steps);
      [[unroll]] for (uint s = 0u; s < steps; ++s) {
        uint x = first + part + s;
        make_keys(s);
        float sure;
        int winner = left_winner(sure);
        if (part + s == lane()) own_winner = winner, own_sureness = sure;
        if (x < end) right_step(x);
      }
    }
    uint x = first + lane();
    if (!valid || x >= end) continue;
    push.unchecked.at[pixel_row + x] = disparity_at(x, own_winner);
    if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[pixel_row + x] = own_sureness;
  }
  flush_right(end);
}
